"use strict";
// The report on one file. The text of the file never becomes part of the page: it is shown as an image, and only the
// outlines of its shapes are copied, attribute by attribute, so that they can be pointed at.
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const ROW = 32; // px, as in .option
  const OUTLINES = ["path", "rect", "circle", "ellipse", "line", "polyline", "polygon"];
  const GEOMETRY = ["d", "x", "y", "width", "height", "cx", "cy", "r", "rx", "ry", "x1", "y1", "x2", "y2", "points"];

  const { byId, counted, node } = warpsplat;
  const { svg, view, listing, name } = warpsplat.data();
  const { viewer } = byId("viewer");
  const file = new DOMParser().parseFromString(svg, "image/svg+xml");
  const elements = file.getElementsByTagName("*");
  const root = file.documentElement;

  // The picture, without the layers that are switched off.

  let shownUrl = "";
  const showFile = () => {
    const before = shownUrl;
    const text = file.querySelector("parsererror") ? svg : new XMLSerializer().serializeToString(file);
    shownUrl = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
    viewer.set("svg", shownUrl);
    if (before) setTimeout(() => URL.revokeObjectURL(before), 5000);
  };
  if (view) root.setAttribute("viewBox", view);
  root.setAttribute("width", viewer.width);
  root.setAttribute("height", viewer.height);
  showFile();

  const setVisible = (index, visible) => {
    const element = index === null ? null : elements[index];
    if (!element?.style) return;
    if (visible) element.style.removeProperty("display");
    else element.style.setProperty("display", "none", "important");
    if (!element.getAttribute("style")) element.removeAttribute("style");
  };

  byId("download").href = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  byId("download").download = name;
  viewer.addEventListener("show", () => {
    byId("legend").hidden = viewer.shown("left") !== "error" && viewer.shown("right") !== "error";
  });
  if (!listing) return;

  const count = listing.kinds.length;
  const off = new Set(); // numbers of layers, and "background"
  const isOff = (shape) => off.has(listing.layers[shape]);

  // Outlines, which can be pointed at in the picture.

  const svgNode = (tag, attributes = {}) => {
    const element = document.createElementNS(SVG, tag);
    for (const [key, value] of Object.entries(attributes)) if (value) element.setAttribute(key, value);
    return element;
  };

  const overlay = svgNode("svg", {
    viewBox: root.getAttribute("viewBox") ?? `0 0 ${viewer.width} ${viewer.height}`,
    preserveAspectRatio: root.getAttribute("preserveAspectRatio"),
    "aria-hidden": "true",
  });
  const hits = overlay.appendChild(svgNode("g"));
  const hot = overlay.appendChild(svgNode("g", { class: "hot" }));
  viewer.overlay.append(overlay);

  const inherited = (element, attribute) => element.closest(`[${attribute}]`)?.getAttribute(attribute);

  // The outline of a shape in the root's units; null if more than attributes determine its place.
  const outlineOf = (shape) => {
    const source = listing.elements[shape] === null ? null : elements[listing.elements[shape]];
    if (!source || !OUTLINES.includes(source.localName)) return null;
    const transforms = [];
    for (let at = source; at && at !== root; at = at.parentElement) {
      if (at.localName === "svg" || at.localName === "symbol") return null;
      if (at.hasAttribute("transform")) transforms.unshift(at.getAttribute("transform"));
    }
    const isStroke = listing.kinds[shape] === "stroke";
    const outline = svgNode(source.localName, {
      transform: transforms.join(" "),
      "fill-rule": inherited(source, "fill-rule"),
      class: isStroke ? "hit stroke" : "hit",
      "stroke-width": isStroke ? (inherited(source, "stroke-width") ?? "1") : "",
    });
    for (const key of GEOMETRY) if (source.hasAttribute(key)) outline.setAttribute(key, source.getAttribute(key));
    outline.dataset.shape = shape;
    return outline;
  };

  let outlines = null; // made when the browser is idle, or when they are needed
  const hideOutlines = () => outlines?.forEach((outline, shape) => outline && (outline.style.display = isOff(shape) ? "none" : ""));
  const trace = () => {
    if (outlines) return;
    outlines = listing.kinds.map((_, shape) => outlineOf(shape));
    hits.append(...outlines.filter(Boolean));
    hideOutlines();
  };
  (globalThis.requestIdleCallback ?? setTimeout)(trace);

  // The marked shape, in the picture and in the list.

  let selected = null;
  let marked = null;
  const mark = (shape) => {
    if (shape === marked) return;
    marked = shape;
    hot.replaceChildren();
    for (const row of list.querySelectorAll(".option.hot")) row.classList.remove("hot");
    describe(shape ?? selected);
    if (shape === null) return;
    trace();
    for (const kind of listing.kinds[shape] === "stroke" ? ["band wide", "band"] : ["halo", "edge"]) {
      const copy = outlines[shape]?.cloneNode();
      if (!copy) break;
      copy.setAttribute("class", kind);
      copy.style.display = "";
      hot.append(copy);
    }
    byId(`shape-${shape}`)?.classList.add("hot");
  };

  const decibels = (value) => {
    const size = Math.abs(value);
    const text = size >= 10 ? size.toFixed(1) : size >= 0.1 ? size.toFixed(2) : size.toFixed(3);
    return (value < 0 && Number(text) !== 0 ? "−" : "") + text;
  };

  const explanation = byId("detail").textContent;
  const describe = (shape) => {
    const contribution = listing.contributions[shape];
    const parts = shape === null ? [explanation] : [
      `${shape + 1} of ${count} from the back`,
      listing.kinds[shape] === "kept" ? "kept unchanged" : `${listing.kinds[shape]} ${listing.colors[shape].join(" to ")}`,
      listing.opacities[shape] < 1 ? `${Math.round(100 * listing.opacities[shape])} % opaque` : "opaque",
      contribution === null ? "" : `without it ${decibels(Math.abs(contribution))} dB ${contribution < 0 ? "more" : "less"}`,
    ];
    byId("detail").textContent = parts.filter(Boolean).join(" · ");
  };

  // The list, which has only the rows that are visible.

  const list = byId("list");
  const space = list.querySelector(".list-space");
  const most = Math.max(1e-9, ...listing.contributions.map((value) => value ?? 0));
  const places = new Int32Array(count);
  let order = [];

  const cell = (className, text = "") => node("span", { className }, text);

  const rowOf = (shape) => {
    const contribution = listing.contributions[shape];
    const text = contribution === null ? "" : `${decibels(contribution)} dB`;
    const swatch = cell(`swatch ${listing.kinds[shape]}`);
    const [first, last] = listing.colors[shape];
    if (first) swatch.style.background = last ? `linear-gradient(90deg, ${first}, ${last})` : first;
    const bar = cell("contribution-bar");
    bar.style.width = `${100 * Math.sqrt(Math.max(0, contribution ?? 0) / most)}%`;
    if (contribution === null) bar.style.visibility = "hidden";
    const row = node(
      "div",
      {
        id: `shape-${shape}`,
        className: `option${shape === marked ? " hot" : ""}${isOff(shape) ? " off" : ""}`,
        role: "option",
        ariaSelected: String(shape === selected),
        ariaPosInSet: places[shape] + 1,
        ariaSetSize: count,
      },
      swatch, cell("number quiet", `${shape + 1}`), cell("quiet", listing.kinds[shape]), bar,
      cell(`number${text.startsWith("−") ? " bad" : ""}`, text),
    );
    row.dataset.shape = shape;
    row.style.transform = `translateY(${places[shape] * ROW}px)`;
    return row;
  };

  const draw = (all = false) => {
    if (all) space.replaceChildren();
    space.style.height = `${count * ROW}px`;
    const first = Math.max(0, Math.floor(list.scrollTop / ROW) - 6);
    const last = Math.ceil((list.scrollTop + list.clientHeight) / ROW) + 6;
    const wanted = new Set(order.slice(first, last));
    for (const row of [...space.children]) if (!wanted.delete(Number(row.dataset.shape))) row.remove();
    space.append(...[...wanted].map(rowOf));
  };

  const sort = (by) => {
    const value = (shape) => listing.contributions[shape] ?? -Infinity;
    const orders = {
      most: (a, b) => value(b) - value(a) || a - b,
      least: (a, b) => value(a) - value(b) || a - b,
      front: (a, b) => b - a,
      back: (a, b) => a - b,
    };
    order = [...Array(count).keys()].sort(orders[by]);
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
    byId(`shape-${selected}`)?.setAttribute("aria-selected", "false");
    selected = shape;
    if (shape === null) list.removeAttribute("aria-activedescendant");
    else {
      reveal(shape);
      byId(`shape-${shape}`)?.setAttribute("aria-selected", "true");
      list.setAttribute("aria-activedescendant", `shape-${shape}`);
    }
    mark(shape);
    describe(shape);
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
    const shape = shapeOf(event.detail);
    if (shape !== null) reveal(shape);
    mark(shape ?? selected);
  });
  viewer.addEventListener("leave", () => mark(selected));
  viewer.addEventListener("tap", (event) => select(shapeOf(event.detail)));

  // Layers.

  const toggle = (layer, visible) => {
    if (visible) off.delete(layer);
    else off.add(layer);
    if (layer === "background") setVisible(listing.background, visible);
    else listing.elements.forEach((element, shape) => listing.layers[shape] === layer && setVisible(element, visible));
    hideOutlines();
    if (selected !== null && isOff(selected)) select(null);
    draw(true);
    showFile();
  };
  const addLayer = (layer, text, title) => {
    const input = node("input", { type: "checkbox", checked: true });
    input.addEventListener("change", () => toggle(layer, input.checked));
    byId("layers").append(node("label", { title }, input, text));
  };
  if (listing.background !== null) addLayer("background", "Background", "Behind all shapes");
  listing.names.forEach((text, layer) => {
    addLayer(layer, text, counted(listing.layers.filter((one) => one === layer).length, "shape"));
  });

  byId("count").textContent = String(count);
  const by = byId("order");
  if (listing.contributions.every((value) => value === null)) {
    by.querySelectorAll('[value="most"], [value="least"]').forEach((option) => option.remove());
    byId("detail").textContent = "";
  }
  by.addEventListener("change", () => sort(by.value));
  sort(by.value);
  new ResizeObserver(() => draw()).observe(list);
})();
