"use strict";
// The list of a batch: filtered and sorted here; of long ones more rows come as they are scrolled to.
(() => {
  const CHUNK = 100; // rows made at a time
  const TITLES = { psnr: "PSNR [dB]", bytes: "Size [kB]", shapes: "Shapes", seconds: "Time [s]" };
  const SHOWN = {
    psnr: (row) => (row.exact ? "exact" : row.psnr?.toFixed(2)),
    bytes: (row) => (row.bytes === null ? undefined : (row.bytes / 1000).toFixed(1)),
    shapes: (row) => row.shapes?.toLocaleString("en").replaceAll(",", "\u2009"),
    seconds: (row) => row.seconds?.toFixed(1),
  };

  const { rows } = JSON.parse(document.getElementById("data").textContent);
  rows.forEach((row, place) => (row.place = place));
  const byId = (id) => document.getElementById(id);
  const body = document.querySelector("#images tbody");
  let key = "place";
  let rising = true;
  let found = [];
  let made = 0;

  const node = (tag, kind, text = "") => {
    const element = document.createElement(tag);
    if (kind) element.className = kind;
    element.textContent = text;
    return element;
  };

  const linked = (text, href) => {
    if (!href) return document.createTextNode(text);
    const link = node("a", "", text);
    link.setAttribute("href", href);
    return link;
  };

  const rowOf = (row) => {
    const line = node("tr", row.status);
    const pair = node("div", "pair");
    if (row.thumbnail) {
      const image = node("img", "");
      image.src = row.thumbnail;
      image.alt = "";
      image.loading = "lazy";
      pair.append(image);
    }
    const named = node("td", "");
    const called = node("div", "called");
    called.append(linked(row.name, row.report || row.svg));
    const rest = node("div", "small quiet");
    if (row.svg) rest.append(linked(row.output, row.svg));
    else if (!row.error) rest.append(row.status === "stopped" ? "stopped" : "not made yet");
    named.append(called, rest);
    if (row.error) named.append(node("div", "message", row.error));
    const first = node("td", "");
    if (row.thumbnail) first.append(pair);
    line.append(first, named);
    for (const name of Object.keys(TITLES)) {
      const cell = node("td", "number", SHOWN[name](row) ?? "");
      cell.dataset.title = TITLES[name];
      line.append(cell);
    }
    return line;
  };

  const more = () => {
    body.append(...found.slice(made, made + CHUNK).map(rowOf));
    made = Math.min(found.length, made + CHUNK);
  };

  const names = new Intl.Collator(undefined, { numeric: true });
  const compared = (a, b) => {
    if (key === "name") return names.compare(a.name, b.name) || a.place - b.place;
    const value = (row) => (key === "psnr" && row.exact ? Infinity : row[key]);
    return value(a) === value(b) ? a.place - b.place : value(a) - value(b);
  };

  const show = () => {
    const words = byId("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const status = byId("status").value;
    found = rows.filter((row) => {
      const text = `${row.folder}/${row.name} ${row.output} ${row.error}`.toLowerCase();
      const is = !status || row.status === status || (status === "open" && row.status === "stopped");
      return is && words.every((word) => text.includes(word));
    });
    const isMissing = (row) => key !== "name" && row[key] === null && !(key === "psnr" && row.exact);
    const known = found.filter((row) => !isMissing(row)).sort(compared);
    if (!rising) known.reverse();
    found = [...known, ...found.filter(isMissing)]; // what has no figure comes last, either way
    body.replaceChildren();
    made = 0;
    more();
    byId("found").value = found.length === rows.length ? "" : `${found.length} of ${rows.length}`;
    byId("nothing").hidden = found.length > 0;
    byId("sort").value = key;
    byId("direction").textContent = rising ? "↑" : "↓";
    byId("direction").ariaLabel = rising ? "Ascending; press for descending" : "Descending; press for ascending";
    for (const head of document.querySelectorAll("#images th[data-key]")) {
      if (head.dataset.key === key) head.setAttribute("aria-sort", rising ? "ascending" : "descending");
      else head.removeAttribute("aria-sort");
    }
  };

  const sortBy = (name) => {
    rising = name === key ? !rising : name !== "psnr";
    key = name;
    show();
  };

  for (const head of document.querySelectorAll("#images th[data-key]")) {
    head.querySelector("button").addEventListener("click", () => sortBy(head.dataset.key));
  }
  byId("sort").addEventListener("change", () => sortBy(byId("sort").value));
  byId("direction").addEventListener("click", () => sortBy(key));
  byId("filter").addEventListener("input", show);
  byId("status").addEventListener("change", show);
  const end = byId("nothing");
  const edge = document.createElement("div");
  end.after(edge);
  new IntersectionObserver((seen) => seen.some((one) => one.isIntersecting) && made < found.length && more(), {
    rootMargin: "800px",
  }).observe(edge);
  show();
})();
