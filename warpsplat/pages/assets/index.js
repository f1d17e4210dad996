"use strict";
// The list of a batch: filtered and sorted here; of long lists more rows are made when they are scrolled to.
(() => {
  const CHUNK = 100; // rows made at a time
  const { byId, node } = warpsplat;
  const COLUMNS = {
    psnr: ["PSNR [dB]", (row) => (row.exact ? "exact" : row.psnr?.toFixed(2))],
    bytes: ["Size [kB]", (row) => (row.bytes === null ? undefined : (row.bytes / 1000).toFixed(1))],
    shapes: ["Shapes", (row) => row.shapes?.toLocaleString("en").replaceAll(",", "\u2009")],
    seconds: ["Time [s]", (row) => row.seconds?.toFixed(1)],
  };

  const { rows } = warpsplat.data();
  rows.forEach((row, place) => (row.place = place));
  const body = document.querySelector("#images tbody");
  const heads = [...document.querySelectorAll("#images th[data-key]")];
  let key = "place";
  let ascending = true;
  let found = [];
  let made = 0; // rows of `found` in the table

  const linked = (text, href) => (href ? node("a", { href }, text) : text);

  const rowOf = (row) => {
    const pair = node("td");
    if (row.thumbnail) {
      pair.append(node("div", { className: "pair" }, node("img", { src: row.thumbnail, alt: "", loading: "lazy" })));
    }
    const output = row.svg ? linked(row.output, row.svg) : row.error ? "" : row.status === "stopped" ? "stopped" : "not made yet";
    const named = node(
      "td", {}, node("div", { className: "called" }, linked(row.name, row.report || row.svg)), node("div", { className: "small quiet" }, output),
    );
    if (row.error) named.append(node("div", { className: "message" }, row.error));
    const line = node("tr", { className: row.status }, pair, named);
    for (const [title, text] of Object.values(COLUMNS)) {
      const cell = line.appendChild(node("td", { className: "number" }, text(row) ?? ""));
      cell.dataset.title = title;
    }
    return line;
  };

  const more = () => {
    body.append(...found.slice(made, made + CHUNK).map(rowOf));
    made = Math.min(found.length, made + CHUNK);
  };

  const names = new Intl.Collator(undefined, { numeric: true });
  const value = (row) => (key === "psnr" && row.exact ? Infinity : row[key]);
  const compare = (a, b) => {
    if (key === "name") return names.compare(a.name, b.name) || a.place - b.place;
    return value(a) === value(b) ? a.place - b.place : value(a) - value(b);
  };

  const show = () => {
    const words = byId("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const status = byId("status").value;
    const matches = rows.filter((row) => {
      const text = `${row.folder}/${row.name} ${row.output} ${row.error}`.toLowerCase();
      const is = !status || row.status === status || (status === "open" && row.status === "stopped");
      return is && words.every((word) => text.includes(word));
    });
    const known = matches.filter((row) => value(row) !== null).sort(compare);
    if (!ascending) known.reverse();
    found = [...known, ...matches.filter((row) => value(row) === null)]; // rows without the figure come last
    body.replaceChildren();
    made = 0;
    more();
    byId("found").value = found.length === rows.length ? "" : `${found.length} of ${rows.length}`;
    byId("nothing").hidden = found.length > 0;
    byId("sort").value = key;
    byId("direction").textContent = ascending ? "↑" : "↓";
    byId("direction").ariaLabel = ascending ? "Ascending; press for descending" : "Descending; press for ascending";
    for (const head of heads) head.ariaSort = head.dataset.key !== key ? null : ascending ? "ascending" : "descending";
  };

  const sortBy = (name) => {
    ascending = name === key ? !ascending : name !== "psnr";
    key = name;
    show();
  };

  for (const head of heads) head.querySelector("button").addEventListener("click", () => sortBy(head.dataset.key));
  byId("sort").addEventListener("change", () => sortBy(byId("sort").value));
  byId("direction").addEventListener("click", () => sortBy(key));
  byId("filter").addEventListener("input", show);
  byId("status").addEventListener("change", show);
  const edge = node("div");
  byId("nothing").after(edge);
  const observer = new IntersectionObserver((seen) => seen.some((one) => one.isIntersecting) && more(), { rootMargin: "800px" });
  observer.observe(edge);
  show();
})();
