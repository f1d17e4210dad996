"use strict";
// The page of `warpsplat serve`. The server tells the whole state of this page's session whenever something changes;
// what is shown follows from it, so that a page that was loaded anew is right with the first message.
(() => {
  const $ = (id) => document.getElementById(id);
  const facts = JSON.parse($("facts").textContent);
  const STATES = { waiting: "Waiting", running: "Running", done: "Done", stopped: "Stopped", failed: "Failed" };

  let session = new URLSearchParams(location.hash.slice(1)).get("s");
  let model = { images: [], runs: [] };
  let current = null; // image that is shown
  let viewer = null;
  let follow = null; // run that is shown on the right as soon as it has a picture
  let arriving = null; // image that was just uploaded, to be shown once the server tells of it
  const sources = new Map(); // run -> {key, url}: of its latest picture
  const cards = new Map(); // run -> element

  // Talking to the server.

  async function ask(method, path, body, type) {
    const headers = type ? { "Content-Type": type } : {};
    let answer;
    try {
      answer = await fetch(path, { method, body, headers });
    } catch {
      throw new Error("The server does not answer");
    }
    if (!answer.ok) throw new Error((await answer.text()).trim() || `Status ${answer.status}`);
    return answer.headers.get("Content-Type")?.startsWith("application/json") ? answer.json() : null;
  }

  const at = (...parts) => `/sessions/${[session, ...parts].join("/")}`;

  async function begin() {
    session = (await ask("POST", "/sessions")).session;
    history.replaceState(null, "", `#s=${session}`);
  }

  let begun = null; // by several uploads at once only one session
  const ready = () => (session ? Promise.resolve() : (begun ??= begin().then(listen).finally(() => (begun = null))));

  function listen() {
    const stream = new EventSource(at("events"));
    stream.onmessage = (event) => {
      $("lost").hidden = true;
      model = JSON.parse(event.data);
      show();
    };
    stream.onerror = () => {
      $("lost").hidden = false;
      if (stream.readyState !== EventSource.CLOSED) return; // it tries again by itself
      const had = model.images.length;
      session = null; // forgotten, or of another server
      model = { images: [], runs: [] };
      ready().then(() => {
        $("lost").hidden = true;
        if (had) complain("This page was away for a while: its images and results are gone.");
        show();
      }, (error) => {
        $("lost").hidden = true;
        complain(error.message);
      });
    };
  }

  function complain(text, where = "error") {
    $(where).textContent = text;
    $(where).hidden = !text;
    if (text) $(where).scrollIntoView({ block: "nearest" });
  }

  const attempt = (work, where) => async (...given) => {
    try {
      await work(...given);
    } catch (error) {
      complain(error.message, where);
    }
  };

  // Images come in: chosen, dropped or pasted.

  const upload = attempt(async (files) => {
    complain("");
    if (files.length) await ready();
    const refused = [];
    for (const file of files) {
      const name = file.name || "pasted.png";
      try {
        if (file.size > facts.upload) {
          const size = `has ${(file.size / 1e6).toFixed(1)} MB`;
          throw new Error(`${name}: ${size}; at most ${facts.upload / 1e6} MB are taken`);
        }
        const path = `${at("images")}?name=${encodeURIComponent(name)}`;
        arriving = (await ask("POST", path, file, "application/octet-stream")).image;
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
  const hasFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
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

  // Settings -> a run.

  function chosen() {
    const form = new FormData($("form"));
    const settings = {};
    for (const name of ["subject", "quality", "paint"]) {
      if (form.get(name) !== facts.defaults[name]) settings[name] = form.get(name);
    }
    for (const name of ["curves", "colors"]) if (form.get(name)) settings[name] = Number(form.get(name));
    if (form.get("kind") !== "closed") settings[form.get("kind")] = true;
    return settings;
  }

  const start = attempt(async () => {
    complain("", "refused");
    const request = JSON.stringify({ image: current, settings: chosen() });
    follow = (await ask("POST", at("runs"), request, "application/json")).run;
    $("stage").scrollIntoView({ block: "nearest", behavior: "smooth" }); // on a phone the form lies below it
  }, "refused");
  $("form").addEventListener("submit", (event) => {
    event.preventDefault();
    start();
  });
  $("form").addEventListener("input", () => complain("", "refused"));

  function title(values) {
    const words = [];
    if (values.subject) words.push(values.subject);
    if (values.curves) words.push(`${values.curves} shapes`);
    if (values.open) words.push("strokes");
    if (values.mixed) words.push("fills and strokes");
    if (values.quality) words.push(values.quality);
    if (values.paint) words.push(`${values.paint} paint`);
    if (values.colors) words.push(`${values.colors} colours`);
    return words.join(", ") || "automatic";
  }

  const name = (run) => `${run.number} · ${title(run.values)}`;

  // Figures.

  const kilo = (bytes) => (bytes < 1e6 ? `${(bytes / 1e3).toFixed(bytes < 1e4 ? 1 : 0)}` : `${(bytes / 1e6).toFixed(1)}`);
  const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

  function liveText(run) {
    if (run.state === "waiting") {
      return run.place ? `Waiting: ${run.place} before it` : "Waiting";
    }
    const { live } = run;
    if (run.stopping) return "Stopping, and measuring the file";
    const words = [`${Math.floor(100 * live.work)} %`];
    if (live.shapes) words.push(`${live.shapes} shapes`);
    if (live.psnr != null) words.push(live.fine ? `${live.psnr.toFixed(1)} dB` : `${live.psnr.toFixed(1)} dB (reduced)`);
    if (live.left != null && live.left >= 1) words.push(`${clock(live.left)} left`);
    return live.note || words.join(" · ");
  }

  function figures(run) {
    const { figures } = run;
    const rows = [];
    if (figures.psnr != null) rows.push([figures.psnr.toFixed(2), "dB", "PSNR"]);
    else if (figures.ssim === 1) rows.push(["exact", "", "PSNR"]);
    if (figures.bytes != null) rows.push([kilo(figures.bytes), figures.bytes < 1e6 ? "kB" : "MB", "SVG"]);
    rows.push([figures.shapes, "", "Shapes"]);
    rows.push([figures.seconds < 60 ? figures.seconds.toFixed(1) : clock(figures.seconds), figures.seconds < 60 ? "s" : "", "Time"]);
    return rows.map(([value, unit, label]) => {
      const row = document.createElement("div");
      const [term, data, small] = ["dt", "dd", "small"].map((tag) => document.createElement(tag));
      term.textContent = label;
      small.textContent = unit;
      data.append(String(value), unit ? "\u00a0" : "", small);
      row.append(term, data);
      return row;
    });
  }

  // Pictures of runs: those of one that goes on are fetched one at a time, as fast as they come.

  const isOver = (run) => !["waiting", "running"].includes(run.state);
  const hasFile = (run) => run.state === "done" || run.state === "stopped";
  const fetching = new Set();

  function picture(run) {
    const old = sources.get(run.id);
    if (hasFile(run)) {
      const url = at("runs", run.id, "result.svg");
      if (old?.url !== url) source(run.id, "result", url);
      return;
    }
    const number = run.live?.pictures;
    if (!number || old?.key === number || fetching.has(run.id)) return;
    fetching.add(run.id);
    fetch(at("runs", run.id, "live.svg"))
      .then((answer) => (answer.ok ? answer.blob() : null))
      .then((blob) => {
        if (blob && sources.get(run.id)?.key !== "result") source(run.id, number, URL.createObjectURL(blob));
      })
      .catch(() => {})
      .finally(() => {
        fetching.delete(run.id);
        show();
      });
  }

  function source(id, key, url) {
    const old = sources.get(id)?.url;
    sources.set(id, { key, url });
    if (old?.startsWith("blob:")) setTimeout(() => URL.revokeObjectURL(old), 2000); // it may be shown still
  }

  function forget(id) {
    const old = sources.get(id)?.url;
    if (old?.startsWith("blob:")) URL.revokeObjectURL(old);
    sources.delete(id);
    cards.get(id)?.remove();
    cards.delete(id);
  }

  // The slider.

  function open(image) {
    current = image.id;
    const root = $("viewer-template").content.firstElementChild.cloneNode(true);
    root.dataset.width = image.width;
    root.dataset.height = image.height;
    root.classList.toggle("transparent", image.transparent);
    root.querySelector(".viewer-stage").style.aspectRatio = `${image.width} / ${image.height}`;
    $("stage").replaceChildren(root);
    viewer = new warpsplat.Viewer(root);
    viewer.set("image", at("images", image.id));
    viewer.addEventListener("show", show);
    const latest = model.runs.filter((run) => run.image === image.id).at(-1);
    follow = latest?.id ?? null;
  }

  function offer(run) {
    const { url } = sources.get(run.id);
    if (!viewer.images(run.id).length) {
      for (const plane of viewer.root.querySelectorAll(".viewer-side .viewer-plane")) {
        const image = new Image();
        image.dataset.name = run.id;
        image.alt = name(run);
        image.draggable = false;
        image.decoding = "sync";
        image.hidden = true;
        plane.append(image);
      }
      for (const choice of viewer.root.querySelectorAll("select[data-side]")) choice.add(new Option(name(run), run.id));
    }
    for (const image of viewer.images(run.id)) if (image.src !== new URL(url, location.href).href) image.src = url;
  }

  function withdraw(id) {
    for (const side of ["left", "right"]) if (viewer.shown(side) === id) viewer.show(side, "image");
    for (const image of viewer.images(id)) image.remove();
    for (const option of viewer.root.querySelectorAll("option")) if (option.value === id) option.remove();
  }

  // Everything, from the state.

  function show() {
    const images = new Map(model.images.map((image) => [image.id, image]));
    if (arriving && images.has(arriving)) {
      open(images.get(arriving));
      arriving = null;
      $("form").querySelector(".go").focus({ preventScroll: true });
    } else if (!images.has(current)) {
      current = null;
      viewer = null;
      if (model.images.length && !arriving) open(model.images.at(-1));
    }
    $("drop").hidden = Boolean(current);
    $("another").hidden = !current;
    $("work").hidden = !current;
    showImages();
    const runs = model.runs.filter((run) => run.image === current);
    for (const run of runs) picture(run);
    const ids = new Set(model.runs.map((run) => run.id));
    for (const id of [...sources.keys(), ...cards.keys()]) if (!ids.has(id)) forget(id);
    if (viewer) showRuns(runs);
    $("results").hidden = !runs.length;
    const running = model.runs.find((run) => run.state === "running");
    document.title = running ? `${Math.floor(100 * running.live.work)} % · warpsplat` : "warpsplat";
  }

  function showImages() {
    const list = $("images");
    list.hidden = model.images.length < 2;
    const ids = model.images.map((image) => image.id);
    for (const item of [...list.children]) if (!ids.includes(item.dataset.id)) item.remove();
    for (const image of model.images) {
      let item = [...list.children].find((each) => each.dataset.id === image.id);
      if (!item) {
        item = document.createElement("li");
        item.dataset.id = image.id;
        const pick = document.createElement("button");
        pick.className = "pick";
        pick.title = image.name;
        const thumb = new Image();
        thumb.src = at("images", image.id);
        thumb.alt = image.name;
        pick.append(thumb);
        pick.addEventListener("click", () => {
          open(image);
          show();
        });
        const remove = document.createElement("button");
        remove.className = "drop-one";
        remove.textContent = "×";
        remove.title = `Remove ${image.name} and its results`;
        remove.setAttribute("aria-label", remove.title);
        remove.addEventListener("click", attempt(() => ask("DELETE", at("images", image.id))));
        item.append(pick, remove);
        list.append(item);
      }
      item.firstChild.setAttribute("aria-current", String(image.id === current));
    }
  }

  function showRuns(runs) {
    const names = new Set(["image", ...runs.map((run) => run.id)]);
    for (const shown of new Set([...viewer.root.querySelectorAll("img")].map((image) => image.dataset.name))) {
      if (!names.has(shown)) withdraw(shown);
    }
    for (const run of runs) if (sources.has(run.id)) offer(run);
    if (follow && sources.has(follow) && viewer.images(follow).length) {
      const wanted = follow;
      follow = null;
      viewer.show("right", wanted);
      return; // which shows everything
    }
    const shown = runs.map((run) => card(run));
    const wanted = shown.toReversed?.() ?? [...shown].reverse(); // the latest first
    if (wanted.some((element, place) => $("results").children[place] !== element) || $("results").children.length !== wanted.length) {
      $("results").replaceChildren(...wanted);
    }
  }

  function card(run) {
    let element = cards.get(run.id);
    if (!element) {
      element = $("run-template").content.firstElementChild.cloneNode(true);
      element.addEventListener("click", (event) => act(run.id, event.target.closest("[data-do]")?.dataset.do));
      element.querySelector("h3").textContent = name(run);
      element.setAttribute("aria-label", name(run));
      element.querySelector('[data-do="show"]').setAttribute("aria-label", `Show ${name(run)} under the slider`);
      cards.set(run.id, element);
    }
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
    const stop = part('[data-do="stop"]');
    stop.textContent = run.state === "waiting" ? "Leave the queue" : "Stop here";
    stop.disabled = Boolean(run.stopping);
    const bar = part("progress");
    if (run.state === "running" && run.live.work) bar.value = run.live.work;
    else if (run.state === "waiting") bar.value = 0;
    else bar.removeAttribute("value");
    bar.setAttribute("aria-label", `Progress of ${name(run)}`);
    for (const side of ["left", "right"]) {
      part(`[data-do="${side}"]`).hidden = !url;
      part(`[data-do="${side}"]`).setAttribute("aria-pressed", String(viewer.shown(side) === run.id));
    }
    if (element.dataset.state !== run.state) {
      if (element.dataset.state && isOver(run)) $("said").textContent = `${name(run)}: ${STATES[run.state]}`;
      element.dataset.state = run.state;
      if (hasFile(run)) finish(run, part);
    }
    return element;
  }

  function finish(run, part) {
    part(".figures").replaceChildren(...figures(run));
    const notes = [];
    if (run.state === "stopped") notes.push("Stopped: the best so far.");
    if (run.figures.why && run.figures.subject !== "photo") notes.push(`Taken for a ${run.figures.subject}: ${run.figures.why}.`);
    if (run.figures.reduced) notes.push(`${run.figures.reduced}.`);
    part(".why").textContent = notes.join(" ");
    part(".why").hidden = !notes.length;
    const image = model.images.find((each) => each.id === run.image);
    const link = part('[data-do="download"]');
    link.href = `${at("runs", run.id, "result.svg")}?download`;
    link.download = `${image.name.replace(/\.[^.]*$/, "")}.svg`;
    part('[data-do="copy"]').title = run.command;
  }

  const act = attempt(async (id, what) => {
    const run = model.runs.find((each) => each.id === id);
    if (!run || !what) return;
    if (what === "stop") await ask("POST", at("runs", id, "stop"));
    if (what === "remove") await ask("DELETE", at("runs", id));
    if (what === "left" || what === "right") viewer.show(what, viewer.shown(what) === id ? "image" : id);
    if (what === "show") {
      if (sources.has(id)) viewer.show("right", id);
      $("stage").scrollIntoView({ block: "nearest", behavior: "smooth" });
    }
    if (what === "copy") await copy(run);
  });

  async function copy(run) {
    const button = cards.get(run.id).querySelector('[data-do="copy"]');
    try {
      await navigator.clipboard.writeText(run.command);
      button.textContent = "Copied";
    } catch {
      complain(run.command); // browsers let pages of this machine copy, and few others
    }
    setTimeout(() => (button.textContent = "Copy command"), 1500);
  }

  if (session) listen();
  else ready().catch((error) => complain(error.message));
})();
