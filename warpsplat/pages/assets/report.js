"use strict";
// The report of one file: its shapes are found in its text, which is never a part of the page: it is shown as an
// image, and only outlines are copied, attribute by attribute, to be pointed at.
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const ROW = 32; // px, as .option says
  const OUTLINES = ["path", "rect", "circle", "ellipse", "line", "polyline", "polygon"];
  const GEOMETRY = ["d", "x", "y", "width", "height", "cx", "cy", "r", "rx", "ry", "x1", "y1", "x2", "y2", "points"];

  const { svg, view, listing, name } = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const viewer = byId("viewer").viewer;
  const file = new DOMParser().parseFromString(svg, "image/svg+xml");
  const elements = file.getElementsByTagName("*");

  // The picture, without what is switched off.

  let shownUrl = "";
  const showFile = () => {
    const before = shownUrl;
    const text = file.querySelector("parsererror") ? svg : new XMLSerializer().serializeToString(file);
    shownUrl = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
    viewer.set("svg", shownUrl);
    if (before) setTimeout(() => URL.revokeObjectURL(before), 5000);
  };
  if (view) file.documentElement.setAttribute("viewBox", view);
  file.documentElement.setAttribute("width", viewer.width);
  file.documentElement.setAttribute("height", viewer.height);
  showFile();

  const setShown = (index, is) => {
    if (index === null || !elements[index]?.style) return;
    if (is) elements[index].style.removeProperty("display");
    else elements[index].style.setProperty("display", "none", "important");
    if (!elements[index].getAttribute("style")) elements[index].removeAttribute("style");
  };

  const download = byId("download");
  download.href = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  download.download = name;

  viewer.addEventListener("show", () => {
    byId("legend").hidden = viewer.shown("left") !== "error" && viewer.shown("right") !== "error";
  });

  if (!listing) return;

  const count = listing.kinds.length;
  const off = new Set(); // numbers of layers, and "background"
  const isOff = (shape) => off.has(listing.layers[shape]);

  // Outlines, to be pointed at in the picture.

  const made = (tag, attributes) => {
    const element = document.createElementNS(SVG, tag);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    return element;
  };

  const root = file.documentElement;
  const box = root.getAttribute("viewBox") ?? `0 0 ${viewer.width} ${viewer.height}`;
  const overlay = made("svg", { viewBox: box, "aria-hidden": "true" });
  const fit = root.getAttribute("preserveAspectRatio");
  if (fit) overlay.setAttribute("preserveAspectRatio", fit);
  const hits = overlay.appendChild(made("g", {}));
  const hot = overlay.appendChild(made("g", { class: "hot" }));
  viewer.overlay.append(overlay);

  const inherited = (element, attribute) => element?.closest?.(`[${attribute}]`)?.getAttribute(attribute);

  // The outline of a shape alone, where the root's units are; null where something else than attributes places it.
  const outlineOf = (shape) => {
    const source = elements[listing.elements[shape]];
    if (!source || listing.elements[shape] === null || !OUTLINES.includes(source.localName)) return null;
    const transforms = [];
    for (let at = source; at && at !== root; at = at.parentElement) {
      if (at.localName === "svg" || at.localName === "symbol") return null;
      if (at.hasAttribute("transform")) transforms.unshift(at.getAttribute("transform"));
    }
    const outline = made(source.localName, {});
    for (const key of GEOMETRY) if (source.hasAttribute(key)) outline.setAttribute(key, source.getAttribute(key));
    if (transforms.length) outline.setAttribute("transform", transforms.join(" "));
    const rule = inherited(source, "fill-rule");
    if (rule) outline.setAttribute("fill-rule", rule);
    return outline;
  };

  const widthOf = (shape) => inherited(elements[listing.elements[shape]], "stroke-width") ?? "1";

  const outlines = new Array(count).fill(null);
  let isTraced = false;
  const trace = () => {
    if (isTraced) return;
    isTraced = true;
    const all = document.createDocumentFragment();
    for (let shape = 0; shape < count; shape++) {
      const outline = outlineOf(shape);
      if (!outline) continue;
      const isStroke = listing.kinds[shape] === "stroke";
      outline.setAttribute("class", isStroke ? "hit stroke" : "hit");
      if (isStroke) outline.setAttribute("stroke-width", widthOf(shape));
      outline.dataset.shape = shape;
      outlines[shape] = outline;
      all.append(outline);
    }
    hits.append(all);
    hideOutlines();
  };
  const hideOutlines = () => {
    outlines.forEach((outline, shape) => outline?.toggleAttribute("hidden", isOff(shape)));
    outlines.forEach((outline, shape) => outline && (outline.style.display = isOff(shape) ? "none" : ""));
  };
  (globalThis.requestIdleCallback ?? setTimeout)(trace);

  // One shape is marked, in the picture and in the list.

  let selected = null;
  let marked = null;
  const mark = (shape) => {
    if (shape === marked) return;
    marked = shape;
    hot.replaceChildren();
    for (const node of list.querySelectorAll(".option.hot")) node.classList.remove("hot");
    tell(shape ?? selected);
    const outline = shape === null ? null : (trace(), outlines[shape]);
    if (outline) {
      const copies = listing.kinds[shape] === "stroke" ? ["band wide", "band"] : ["halo", "edge"];
      for (const kind of copies) {
        const copy = outline.cloneNode();
        copy.setAttribute("class", kind);
        copy.style.display = "";
        hot.append(copy);
      }
    }
    byId(`shape-${shape}`)?.classList.add("hot");
  };

  const worthText = (worth) => {
    if (worth === null) return "";
    const size = Math.abs(worth);
    const text = size >= 10 ? size.toFixed(1) : size >= 0.1 ? size.toFixed(2) : size.toFixed(3);
    return (worth < 0 && Number(text) !== 0 ? "−" : "") + text;
  };

  const told = byId("detail").textContent;
  const tell = (shape) => {
    if (shape === null) {
      byId("detail").textContent = told;
      return;
    }
    const colors = listing.colors[shape].join(" to ");
    const worth = listing.worth[shape];
    const parts = [
      `${shape + 1} of ${count} from the back`,
      listing.kinds[shape] === "kept" ? "kept as it is" : `${listing.kinds[shape]} ${colors}`,
      listing.opacities[shape] < 1 ? `${Math.round(100 * listing.opacities[shape])} % opaque` : "opaque",
      worth === null ? "" : `without it ${worthText(Math.abs(worth))} dB ${worth < 0 ? "more" : "less"}`,
    ];
    byId("detail").textContent = parts.filter(Boolean).join(" · ");
  };

  // The list: of long ones only the rows that are seen are there.

  const list = byId("list");
  const space = list.querySelector(".list-space");
  const most = Math.max(1e-9, ...listing.worth.map((worth) => worth ?? 0));
  let order = [];
  let places = new Int32Array(count);

  const cell = (text, kind) => {
    const node = document.createElement("span");
    node.className = kind;
    node.textContent = text;
    return node;
  };

  const rowOf = (shape) => {
    const row = document.createElement("div");
    const worth = listing.worth[shape];
    row.id = `shape-${shape}`;
    row.className = `option${shape === marked ? " hot" : ""}${isOff(shape) ? " off" : ""}`;
    row.dataset.shape = shape;
    row.setAttribute("role", "option");
    row.setAttribute("aria-selected", String(shape === selected));
    row.setAttribute("aria-posinset", places[shape] + 1);
    row.setAttribute("aria-setsize", count);
    row.style.transform = `translateY(${places[shape] * ROW}px)`;
    const swatch = cell("", `swatch ${listing.kinds[shape]}`);
    const [first, last] = listing.colors[shape];
    if (first) swatch.style.background = last ? `linear-gradient(90deg, ${first}, ${last})` : first;
    const bar = cell("", "worth-bar");
    bar.style.width = `${100 * Math.sqrt(Math.max(0, worth ?? 0) / most)}%`;
    if (worth === null) bar.style.visibility = "hidden";
    const text = worth === null ? "" : `${worthText(worth)} dB`;
    row.append(
      swatch, cell(`${shape + 1}`, "number quiet"), cell(listing.kinds[shape], "quiet"), bar,
      cell(text, `number${worth < 0 && worthText(worth).startsWith("−") ? " bad" : ""}`),
    );
    return row;
  };

  const draw = (anew = false) => {
    if (anew) space.replaceChildren();
    space.style.height = `${order.length * ROW}px`;
    const first = Math.max(0, Math.floor(list.scrollTop / ROW) - 6);
    const last = Math.min(order.length, Math.ceil((list.scrollTop + list.clientHeight) / ROW) + 6);
    const wanted = new Set(order.slice(first, last));
    for (const row of [...space.children]) if (!wanted.delete(Number(row.dataset.shape))) row.remove();
    space.append(...[...wanted].map(rowOf));
  };

  const sort = (by) => {
    const shapes = [...Array(count).keys()];
    const worth = (shape) => listing.worth[shape] ?? -Infinity;
    const orders = {
      most: (a, b) => worth(b) - worth(a) || a - b,
      least: (a, b) => worth(a) - worth(b) || a - b,
      front: (a, b) => b - a,
      back: (a, b) => a - b,
    };
    order = shapes.sort(orders[by]);
    order.forEach((shape, place) => (places[shape] = place));
    list.scrollTop = 0;
    draw(true);
  };

  const reveal = (shape) => {
    const top = places[shape] * ROW;
    if (top < list.scrollTop) list.scrollTop = top - ROW;
    else if (top + ROW > list.scrollTop + list.clientHeight) list.scrollTop = top + 2 * ROW - list.clientHeight;
    draw();
  };

  const select = (shape) => {
    const before = selected;
    selected = shape;
    if (before !== null) byId(`shape-${before}`)?.setAttribute("aria-selected", "false");
    if (shape !== null) {
      reveal(shape);
      byId(`shape-${shape}`)?.setAttribute("aria-selected", "true");
      list.setAttribute("aria-activedescendant", `shape-${shape}`);
    } else list.removeAttribute("aria-activedescendant");
    mark(shape);
    tell(shape);
  };

  const enlarge = (shape) => {
    trace();
    const box = outlines[shape]?.getBoundingClientRect();
    if (!box || isOff(shape)) return;
    const stage = viewer.stage.getBoundingClientRect();
    const x = (box.left - stage.left - viewer.x) / viewer.k;
    const y = (box.top - stage.top - viewer.y) / viewer.k;
    viewer.focus(x, y, Math.max(1, box.width / viewer.k), Math.max(1, box.height / viewer.k));
  };

  const shapeOf = (target) => {
    const found = target?.closest?.("[data-shape]");
    return found ? Number(found.dataset.shape) : null;
  };

  list.addEventListener("scroll", () => draw());
  list.addEventListener("pointermove", (event) => mark(shapeOf(event.target) ?? selected));
  list.addEventListener("pointerleave", () => mark(selected));
  list.addEventListener("click", (event) => {
    const shape = shapeOf(event.target);
    if (shape !== null) select(shape === selected ? null : shape);
  });
  list.addEventListener("dblclick", (event) => {
    const shape = shapeOf(event.target);
    if (shape !== null) (select(shape), enlarge(shape));
  });
  list.addEventListener("keydown", (event) => {
    const at = selected === null ? -1 : places[selected];
    const page = Math.max(1, Math.floor(list.clientHeight / ROW) - 1);
    const goals = {
      ArrowDown: at + 1, ArrowUp: at < 0 ? 0 : at - 1, Home: 0, End: count - 1, PageDown: at + page, PageUp: at - page,
    };
    if (event.key in goals) select(order[Math.min(count - 1, Math.max(0, goals[event.key]))]);
    else if (event.key === "Enter" && selected !== null) enlarge(selected);
    else if (event.key === "Escape") select(null);
    else return;
    event.preventDefault();
  });
  viewer.addEventListener("point", (event) => {
    const shape = shapeOf(event.detail.target);
    if (shape !== null) reveal(shape);
    mark(shape ?? selected);
  });
  viewer.addEventListener("leave", () => mark(selected));
  viewer.addEventListener("tap", (event) => select(shapeOf(event.detail.target)));

  // Layers.

  const layers = byId("layers");
  const sizes = listing.names.map((_, layer) => listing.layers.filter((one) => one === layer).length);
  const toggle = (layer, is) => {
    if (is) off.delete(layer);
    else off.add(layer);
    if (layer === "background") setShown(listing.background, is);
    else listing.elements.forEach((element, shape) => listing.layers[shape] === layer && setShown(element, is));
    hideOutlines();
    if (selected !== null && isOff(selected)) select(null);
    draw(true);
    showFile();
  };
  const choice = (layer, text, title) => {
    const label = document.createElement("label");
    const input = document.createElement("input");
    input.type = "checkbox";
    input.checked = true;
    input.dataset.layer = layer;
    input.addEventListener("change", () => toggle(layer, input.checked));
    label.title = title;
    label.append(input, text);
    layers.append(label);
  };
  if (listing.background !== null) choice("background", "Background", "What lies behind all shapes");
  listing.names.forEach((text, layer) => choice(layer, text, `${sizes[layer]} shapes`));

  byId("count").textContent = String(count);
  const isKnown = listing.worth.some((worth) => worth !== null);
  const by = byId("order");
  if (!isKnown) {
    by.querySelectorAll('[value="most"], [value="least"]').forEach((option) => option.remove());
    byId("detail").textContent = "";
  }
  by.addEventListener("change", () => sort(by.value));
  sort(by.value);
  new ResizeObserver(() => draw()).observe(list);
})();
