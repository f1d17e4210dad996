"use strict";
// The page of `warpsplat serve`. With every change the server sends its whole state, and what is shown follows from it:
// after a reload the page is complete with the first message.
(() => {
  const { byId, counted, node, data } = warpsplat;
  const facts = data();
  const STATES = { waiting: "Waiting", running: "Running", done: "Done", stopped: "Stopped", failed: "Failed" };

  const form = byId("form");
  let model = { images: [], runs: [] };
  let current = null; // image that is shown
  let viewer = null;
  let follow = null; // run that is shown on the right as soon as it has a picture
  let arriving = null; // image that was just uploaded, shown once it is part of the state
  const sources = new Map(); // run -> {key, url} of its latest picture
  const cards = new Map(); // run -> element

  // Requests.

  async function ask(method, path, body, type) {
    const headers = type ? { "Content-Type": type } : {};
    const answer = await fetch(path, { method, body, headers }).catch(() => {
      throw new Error("The server does not answer");
    });
    if (!answer.ok) throw new Error((await answer.text()).trim() || `Status ${answer.status}`);
    return answer;
  }

  const at = (...parts) => `/${parts.join("/")}`;
  const made = async (path, body, type) => (await ask("POST", path, body, type)).json();

  function listen() {
    const stream = new EventSource("/events");
    stream.onmessage = (event) => {
      const had = !byId("lost").hidden && model.images.length;
      byId("lost").hidden = true;
      model = JSON.parse(event.data);
      if (had && !model.images.length) complain("This page was closed for a while: its images and results are gone.");
      show();
    };
    stream.onerror = () => (byId("lost").hidden = false); // the browser tries again
  }

  function complain(text, where = "error") {
    byId(where).textContent = text;
    byId(where).hidden = !text;
    if (text) byId(where).scrollIntoView({ block: "nearest" });
  }

  const attempt = (work, where) => async (...given) => {
    try {
      await work(...given);
    } catch (error) {
      complain(error.message, where);
    }
  };

  // Images: chosen, dropped or pasted.

  const upload = attempt(async (files) => {
    complain("");
    const refused = [];
    for (const file of files) {
      const name = file.name || "pasted.png";
      try {
        if (file.size > facts.upload) {
          throw new Error(`${name}: has ${(file.size / 1e6).toFixed(1)} MB; the limit is ${facts.upload / 1e6} MB`);
        }
        arriving = (await made(`/images?name=${encodeURIComponent(name)}`, file, "application/octet-stream")).image;
        show();
      } catch (error) {
        refused.push(error.message);
      }
    }
    complain(refused.join("\n"));
  });

  for (const input of document.querySelectorAll('input[type="file"]')) {
    input.addEventListener("change", () => {
      upload([...input.files]);
      input.value = "";
    });
  }
  const hasFiles = (event) => event.dataTransfer?.types.includes("Files");
  addEventListener("dragover", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    document.body.classList.add("dragging");
  });
  addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) document.body.classList.remove("dragging");
  });
  addEventListener("drop", (event) => {
    document.body.classList.remove("dragging");
    if (!hasFiles(event)) return;
    event.preventDefault();
    upload([...event.dataTransfer.files]);
  });
  addEventListener("paste", (event) => {
    const files = [...(event.clipboardData?.files ?? [])];
    if (files.length) upload(files);
  });

  // Settings -> a run. What is empty in the form is as the preset has it, else as the program decides.

  const preset = () => facts.presets[form.elements.preset.value] ?? {};
  const base = (name) => String(preset()[name] ?? facts.controls[name].default);
  const isTyped = (name) => ["number", "text"].includes(facts.controls[name].type);

  // Show a preset, and on top the values of a run.
  function fill(values) {
    form.elements.preset.value = values.preset ?? "";
    const given = preset();
    for (const [name, { hint }] of Object.entries(facts.controls)) {
      form.elements[name].value = values[name] ?? (isTyped(name) ? "" : base(name));
      if (isTyped(name)) form.elements[name].placeholder = given[name] ?? hint;
      // Nothing takes back what a preset sets.
      for (const empty of form.querySelectorAll(`[name="${name}"][value=""], [name="${name}"] > [value=""]`)) {
        empty.disabled = name in given;
      }
    }
    const others = Object.entries(given).filter(([name]) => !(name in facts.controls));
    const words = others.map(([name, value]) => (value === true ? name : `${name} ${value}`)).join(", ");
    byId("preset-hint").textContent = words && `Also: ${words}`;
    showNumbers();
  }

  function showNumbers() {
    for (const output of form.querySelectorAll("output")) output.value = form.elements[output.htmlFor.value].value;
  }

  function chosen() {
    const given = new FormData(form);
    const settings = given.get("preset") ? { preset: given.get("preset") } : {};
    for (const [name, { type }] of Object.entries(facts.controls)) {
      const value = given.get(name);
      if (value && value !== base(name)) settings[name] = ["number", "slider"].includes(type) ? Number(value) : value;
    }
    return settings;
  }

  let due = null;
  let asked = { request: "", id: null }; // the latest request, and its run
  const start = attempt(async () => {
    clearTimeout(due);
    complain("", "refused");
    if (!current) return;
    const request = JSON.stringify({ image: current, settings: chosen() });
    const run = model.runs.find((each) => each.id === asked.id);
    const isMade = asked.id === null || (run && !["failed", "stopped"].includes(run.state));
    if (request === asked.request && isMade) return; // as when a change has begun it before the button did
    const one = (asked = { request, id: null });
    const before = follow;
    follow = "coming"; // it replaces a run that is not over, whose picture stays until there is a new one
    try {
      one.id = follow = (await made("/runs", request, "application/json")).run;
    } catch (error) {
      one.request = "";
      follow = before;
      throw error;
    }
    show(); // a short run may be over before its number is here
  }, "refused");
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    start();
    byId("stage").scrollIntoView({ block: "nearest", behavior: "smooth" }); // on a phone the form lies below it
  });
  form.addEventListener("input", () => {
    complain("", "refused");
    showNumbers();
  });
  form.addEventListener("change", ({ target }) => {
    if (target.name === "preset") fill({ preset: target.value });
    clearTimeout(due);
    due = setTimeout(start, 250); // several changes at once, as with a key that is held
  });
  addEventListener("keydown", ({ key }) => {
    const run = model.runs.find((each) => each.image === current && !isOver(each));
    if (key === "Escape" && run) act(run.id, "stop");
  });

  function name({ number, values }) {
    const words = Object.entries(values).map(([key, value]) => {
      if (!(key in facts.controls)) return value; // the preset
      const { label, choices, default: without } = facts.controls[key];
      const word = choices[value]?.toLowerCase() ?? value;
      return choices[without] && without ? word : `${label.toLowerCase()} ${word}`;
    });
    return `${number} · ${words.join(", ") || "automatic"}`;
  }

  // Figures.

  const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

  function liveText(run) {
    if (run.state === "waiting") return run.place ? `Waiting: ${run.place} before it` : "Waiting";
    const { live } = run;
    if (run.stopping) return "Stopping, and measuring the file";
    const words = live.draft ? ["Draft"] : [];
    if (live.work) words.push(`${Math.floor(100 * live.work)} %`);
    if (live.shapes) words.push(counted(live.shapes, "shape"));
    if (live.psnr != null) words.push(`${live.psnr.toFixed(1)} dB${live.fine ? "" : " (reduced)"}`);
    if (live.left != null && live.left >= 1) words.push(`${clock(live.left)} left`);
    return live.note || words.join(" · ") || "Started";
  }

  function size(bytes) {
    if (bytes >= 1e6) return [(bytes / 1e6).toFixed(1), "MB"];
    return [(bytes / 1e3).toFixed(bytes < 1e4 ? 1 : 0), "kB"];
  }

  function figures({ figures: { psnr, exact, bytes, shapes, seconds } }) {
    const rows = [];
    if (psnr != null) rows.push(["PSNR", psnr.toFixed(2), "dB"]);
    else if (exact) rows.push(["PSNR", "exact", ""]);
    if (bytes != null) rows.push(["SVG", ...size(bytes)]);
    rows.push(["Shapes", shapes, ""]);
    rows.push(seconds < 60 ? ["Time", seconds.toFixed(1), "s"] : ["Time", clock(seconds), ""]);
    return rows.map(([label, value, unit]) => {
      const text = node("dd", {}, String(value), unit ? "\u00a0" : "", node("small", {}, unit));
      return node("div", {}, node("dt", {}, label), text);
    });
  }

  // Pictures of runs; live ones are fetched one at a time, as fast as they come.

  const isOver = (run) => !["waiting", "running"].includes(run.state);
  const hasFile = (run) => run.state === "done" || run.state === "stopped";
  const fetching = new Set();

  async function fetchPicture(run) {
    const old = sources.get(run.id);
    if (hasFile(run)) {
      const url = at("runs", run.id, "result.svg");
      if (old?.url !== url) setSource(run.id, "result", url);
      return;
    }
    const number = run.live?.pictures;
    if (!number || old?.key === number || fetching.has(run.id)) return;
    fetching.add(run.id);
    try {
      const answer = await fetch(at("runs", run.id, "live.svg"));
      const blob = answer.status === 200 ? await answer.blob() : null;
      if (blob && sources.get(run.id)?.key !== "result") setSource(run.id, number, URL.createObjectURL(blob));
    } catch {
      // the next state brings another one
    }
    fetching.delete(run.id);
    show();
  }

  function setSource(id, key, url) {
    const old = sources.get(id)?.url;
    sources.set(id, { key, url });
    if (old?.startsWith("blob:")) setTimeout(() => URL.revokeObjectURL(old), 2000); // it may still be shown
  }

  function forget(id) {
    setSource(id, null, null);
    sources.delete(id);
    cards.get(id)?.remove();
    cards.delete(id);
  }

  // The slider.

  function open(image) {
    current = image.id;
    const root = byId("viewer-template").content.firstElementChild.cloneNode(true);
    root.dataset.width = image.width;
    root.dataset.height = image.height;
    root.querySelector(".viewer-stage").style.aspectRatio = `${image.width} / ${image.height}`;
    byId("stage").replaceChildren(root);
    viewer = new warpsplat.Viewer(root);
    viewer.set("image", at("images", image.id));
    viewer.addEventListener("show", show);
    const latest = model.runs.findLast((run) => run.image === image.id);
    follow = latest?.id ?? null;
    if (latest) fill(latest.values);
  }

  // Open an image, and vectorize it at once.
  function enter(image) {
    open(image);
    if (!follow) start();
  }

  function offer(run) {
    if (!viewer.images(run.id).length) {
      for (const plane of viewer.root.querySelectorAll(".viewer-side .viewer-plane")) {
        const image = node("img", { alt: name(run), draggable: false, decoding: "sync", hidden: true });
        image.dataset.name = run.id;
        plane.append(image);
      }
      for (const choice of viewer.root.querySelectorAll("select[data-side]")) choice.add(new Option(name(run), run.id));
    }
    viewer.set(run.id, new URL(sources.get(run.id).url, location.href).href);
  }

  function withdraw(id) {
    for (const side of ["left", "right"]) if (viewer.shown(side) === id) viewer.show(side, "image");
    for (const image of viewer.images(id)) image.remove();
    for (const option of viewer.root.querySelectorAll("option")) if (option.value === id) option.remove();
  }

  // Everything, from the state.

  function show() {
    const images = new Map(model.images.map((image) => [image.id, image]));
    const arrived = images.get(arriving);
    if (arrived) {
      arriving = null;
      enter(arrived);
    } else if (!images.has(current)) {
      current = viewer = null;
      if (model.images.length && !arriving) open(model.images.at(-1));
    }
    byId("drop").hidden = Boolean(current);
    byId("another").hidden = byId("work").hidden = !current;
    if (arrived) form.elements.preset.focus({ preventScroll: true });
    showImages();
    const runs = model.runs.filter((run) => run.image === current);
    for (const run of runs) fetchPicture(run);
    const ids = new Set(model.runs.map((run) => run.id));
    for (const id of [...sources.keys(), ...cards.keys()]) if (!ids.has(id)) forget(id);
    if (viewer) showRuns(runs);
    byId("results").hidden = !runs.length;
    const running = model.runs.find((run) => run.state === "running");
    document.title = running ? `${Math.floor(100 * running.live.work)} % · warpsplat` : "warpsplat";
  }

  const items = new Map(); // image -> element of the list

  function imageItem(image) {
    const thumb = node("img", { src: at("images", image.id), alt: image.name });
    const pick = node("button", { className: "pick", title: image.name }, thumb);
    pick.addEventListener("click", () => {
      enter(image);
      show();
    });
    const title = `Remove ${image.name} and its results`;
    const remove = node("button", { className: "drop-one", title, ariaLabel: title }, "×");
    remove.addEventListener("click", attempt(() => ask("DELETE", at("images", image.id))));
    return node("li", {}, pick, remove);
  }

  function showImages() {
    const list = byId("images");
    list.hidden = model.images.length < 2;
    for (const id of [...items.keys()]) {
      if (model.images.some((image) => image.id === id)) continue;
      items.get(id).remove();
      items.delete(id);
    }
    for (const image of model.images) {
      if (!items.has(image.id)) items.set(image.id, list.appendChild(imageItem(image)));
      items.get(image.id).firstChild.setAttribute("aria-current", String(image.id === current));
    }
  }

  function showRuns(runs) {
    if (runs.some((run) => run.id === follow && run.error)) follow = null;
    const names = new Set(["image", ...runs.map((run) => run.id)]);
    if (follow) names.add(viewer.shown("left")).add(viewer.shown("right")); // until there is something better
    for (const image of viewer.root.querySelectorAll("img")) if (!names.has(image.dataset.name)) withdraw(image.dataset.name);
    for (const run of runs) if (sources.has(run.id)) offer(run);
    if (follow && viewer.images(follow).length) {
      const wanted = follow;
      follow = null;
      viewer.show("right", wanted);
      return; // the event shows everything
    }
    const wanted = runs.map(card).reverse(); // the latest first
    const results = byId("results");
    for (const element of [...results.children]) if (!wanted.includes(element)) element.remove();
    wanted.forEach((element, place) => {
      const there = results.children[place]; // moved only if it has to be: it may have the focus
      if (there !== element) results.insertBefore(element, there ?? null);
    });
  }

  function newCard(run) {
    const element = byId("run-template").content.firstElementChild.cloneNode(true);
    element.addEventListener("click", ({ target }) => act(run.id, target.closest("[data-do]")?.dataset.do));
    for (const button of element.querySelectorAll("[data-save]")) {
      button.addEventListener("click", () => save(run.id, button));
    }
    element.querySelector("h3").textContent = name(run);
    element.ariaLabel = name(run);
    element.querySelector('[data-do="show"]').ariaLabel = `Show ${name(run)} under the slider`;
    element.querySelector("progress").ariaLabel = `Progress of ${name(run)}`;
    cards.set(run.id, element);
    return element;
  }

  function card(run) {
    const element = cards.get(run.id) ?? newCard(run);
    const part = (selector) => element.querySelector(selector);
    const url = sources.get(run.id)?.url;
    const thumb = part(".thumb img");
    if (url && thumb.getAttribute("src") !== url) thumb.src = url;
    part(".thumb").disabled = !url;
    part(".run-live").hidden = isOver(run);
    part(".run-done").hidden = !hasFile(run);
    part(".run-error").hidden = !run.error;
    part(".run-error").textContent = run.error;
    part(".state").textContent = isOver(run) ? "" : liveText(run);
    part('[data-do="stop"]').textContent = run.state === "waiting" ? "Leave the queue" : "Stop here";
    part('[data-do="stop"]').disabled = Boolean(run.stopping);
    if (run.state === "running" && run.live.work) part("progress").value = run.live.work;
    else if (run.state === "waiting") part("progress").value = 0;
    else part("progress").removeAttribute("value");
    for (const side of ["left", "right"]) {
      part(`[data-do="${side}"]`).hidden = !url;
      part(`[data-do="${side}"]`).ariaPressed = String(viewer.shown(side) === run.id);
    }
    if (element.dataset.state !== run.state) {
      if (element.dataset.state && isOver(run)) byId("said").textContent = `${name(run)}: ${STATES[run.state]}`;
      element.dataset.state = run.state;
      if (hasFile(run)) finish(run, part);
    }
    return element;
  }

  function finish(run, part) {
    part(".figures").replaceChildren(...figures(run));
    const { subject, why, notes: noted, reduced } = run.figures;
    const notes = [];
    if (run.state === "stopped") notes.push("Stopped: the best so far.");
    if (why && subject !== "photo") notes.push(`Detected as ${subject}: ${why}.`);
    for (const note of noted || []) notes.push(`${note.charAt(0).toUpperCase()}${note.slice(1)}.`);
    if (reduced) notes.push(`${reduced}.`);
    part(".why").textContent = notes.join(" ");
    part(".why").hidden = !notes.length;
    part('[data-do="copy"]').title = run.command;
  }

  const save = attempt(async (id, button) => {
    if (button.ariaBusy === "true") return;
    button.ariaBusy = "true";
    try {
      const run = model.runs.find((each) => each.id === id);
      const image = model.images.find((each) => each.id === run.image);
      const file = button.dataset.save;
      const href = URL.createObjectURL(await (await ask("GET", at("runs", id, file))).blob());
      const download = image.name.replace(/(\.[^.]*)?$/, file.slice(file.indexOf(".")));
      node("a", { href, download }).click();
      setTimeout(() => URL.revokeObjectURL(href), 10_000);
    } finally {
      button.ariaBusy = "false";
    }
  });

  const act = attempt(async (id, action) => {
    const run = model.runs.find((each) => each.id === id);
    if (!run || !action) return;
    if (action === "stop") await ask("POST", at("runs", id, "stop"));
    if (action === "remove" && follow === id) follow = null;
    if (action === "remove") await ask("DELETE", at("runs", id));
    if (action === "left" || action === "right") viewer.show(action, viewer.shown(action) === id ? "image" : id);
    if (action === "show") {
      if (sources.has(id)) viewer.show("right", id);
      byId("stage").scrollIntoView({ block: "nearest", behavior: "smooth" });
    }
    // Browsers allow it for pages of this machine, and for few others.
    if (action === "copy") {
      await warpsplat.copy(run.command, cards.get(id).querySelector('[data-do="copy"]'), () => complain(run.command));
    }
  });

  listen();
})();
