"use strict";
// Two pictures of one size under a slider, zoomed and panned together (templates/viewer.html.j2).
(() => {
  const MOST = 64; // largest magnification
  const STEP = 1.25; // factor of a key or a button
  const MAGNIFIED = 3; // from this magnification on pixels are shown as squares

  class Viewer extends EventTarget {
    // Events: "point" (detail: the element) when the pointer moves without a button; "tap" (the same) when it is
    // pressed and released in one place; "leave"; "show" when a side shows another picture.

    constructor(root) {
      super();
      this.root = root;
      this.width = Number(root.dataset.width);
      this.height = Number(root.dataset.height);
      this.stage = root.querySelector(".viewer-stage");
      this.overlay = root.querySelector(".viewer-overlay");
      this.handle = root.querySelector(".viewer-handle");
      this.split = 50; // percent of the stage
      this.fitted = true;
      this.k = 1;
      this.x = this.y = 0; // corner of the picture in the stage [px]
      this.pointers = new Map();
      for (const plane of root.querySelectorAll(".viewer-plane")) {
        plane.style.width = `${this.width}px`;
        plane.style.height = `${this.height}px`;
      }
      // The template gives only the left side its pictures, to have each in the file once.
      for (const image of root.querySelectorAll('.viewer-side[data-side="left"] img[src]')) {
        this.set(image.dataset.name, image.src);
      }
      for (const choice of root.querySelectorAll("select[data-side]")) {
        choice.addEventListener("change", () => this.show(choice.dataset.side, choice.value));
      }
      for (const button of root.querySelectorAll("[data-zoom]")) {
        button.addEventListener("click", () => this.command(button.dataset.zoom));
      }
      this.stage.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
      this.stage.addEventListener("keydown", (event) => this.key(event));
      this.listenToPointers();
      this.listenToHandle();
      new ResizeObserver(() => (this.fitted ? this.fit() : this.place())).observe(this.stage);
      this.fit();
      this.setSplit(this.split);
      root.viewer = this;
    }

    // Pictures.

    set(name, url) {
      for (const image of this.images(name)) if (image.src !== url) image.src = url;
    }

    images(name) {
      return [...this.root.querySelectorAll(".viewer-plane img")].filter((image) => image.dataset.name === name);
    }

    show(side, name) {
      for (const image of this.root.querySelectorAll(`.viewer-side[data-side="${side}"] img`)) {
        image.hidden = image.dataset.name !== name;
      }
      const choice = this.root.querySelector(`select[data-side="${side}"]`);
      if (choice) choice.value = name;
      this.dispatchEvent(new Event("show"));
    }

    shown(side) {
      return this.root.querySelector(`.viewer-side[data-side="${side}"] img:not([hidden])`)?.dataset.name;
    }

    // The line between them.

    setSplit(percent) {
      this.split = Math.min(100, Math.max(0, percent));
      this.root.style.setProperty("--split", `${this.split}%`);
      this.handle.setAttribute("aria-valuenow", String(Math.round(this.split)));
      this.handle.setAttribute("aria-valuetext", `${Math.round(this.split)} % of the width`);
    }

    listenToHandle() {
      const drag = (event) => {
        const box = this.stage.getBoundingClientRect();
        this.setSplit((100 * (event.clientX - box.left)) / box.width);
      };
      this.handle.addEventListener("pointerdown", (event) => {
        event.stopPropagation();
        if (event.button === 0) this.handle.setPointerCapture(event.pointerId);
      });
      this.handle.addEventListener("pointermove", (event) => {
        event.stopPropagation();
        if (this.handle.hasPointerCapture(event.pointerId)) drag(event);
      });
      this.handle.addEventListener("keydown", (event) => {
        const step = event.shiftKey ? 10 : 1;
        const places = {
          ArrowLeft: this.split - step, ArrowDown: this.split - step, ArrowRight: this.split + step,
          ArrowUp: this.split + step, PageDown: this.split - 10, PageUp: this.split + 10, Home: 0, End: 100,
        };
        if (!(event.key in places)) return;
        this.setSplit(places[event.key]);
        event.preventDefault();
        event.stopPropagation();
      });
    }

    // Zoom and place.

    get box() {
      return { width: this.stage.clientWidth || 1, height: this.stage.clientHeight || 1 };
    }

    get least() {
      const { width, height } = this.box;
      return Math.min(width / this.width, height / this.height);
    }

    fit() {
      this.k = this.least;
      this.fitted = true;
      this.place();
    }

    // Magnify to k around the point (x, y) of the stage, by default its middle.
    zoomTo(k, x = this.box.width / 2, y = this.box.height / 2) {
      const least = Math.min(this.least, 1);
      const to = Math.min(Math.max(MOST, this.least), Math.max(least, k));
      this.x = x - ((x - this.x) * to) / this.k;
      this.y = y - ((y - this.y) * to) / this.k;
      this.k = to;
      this.fitted = Math.abs(to / this.least - 1) < 1e-6;
      this.place();
    }

    // Bring a rectangle of the picture [px] into view, magnified if it is small.
    focus(x, y, width, height) {
      const box = this.box;
      const room = Math.min((0.5 * box.width) / width, (0.5 * box.height) / height);
      this.k = Math.max(this.least, Math.min(Math.max(8, 4 * this.least), room));
      this.fitted = Math.abs(this.k / this.least - 1) < 1e-6;
      this.x = box.width / 2 - (x + width / 2) * this.k;
      this.y = box.height / 2 - (y + height / 2) * this.k;
      this.place();
    }

    place() {
      const { width, height } = this.box;
      const keep = (at, side, room) => (side <= room ? (room - side) / 2 : Math.min(0, Math.max(room - side, at)));
      this.x = keep(this.x, this.width * this.k, width);
      this.y = keep(this.y, this.height * this.k, height);
      this.root.style.setProperty("--k", String(this.k));
      this.root.style.setProperty("--x", `${this.x}px`);
      this.root.style.setProperty("--y", `${this.y}px`);
      this.root.classList.toggle("magnified", this.k * devicePixelRatio >= MAGNIFIED);
      this.stage.classList.toggle("zoomed", this.k > this.least * 1.001);
      const zoom = this.root.querySelector(".viewer-zoom");
      if (zoom) zoom.value = `${(100 * this.k).toFixed(this.k < 0.1 ? 1 : 0)} %`;
      for (const [name, is] of [["fit", this.fitted], ["actual", Math.abs(this.k - 1) < 1e-6]]) {
        this.root.querySelector(`[data-zoom="${name}"]`)?.setAttribute("aria-pressed", String(is));
      }
    }

    command(name) {
      if (name === "fit") this.fit();
      if (name === "actual") this.zoomTo(1);
      if (name === "in") this.zoomTo(this.k * STEP);
      if (name === "out") this.zoomTo(this.k / STEP);
    }

    wheel(event) {
      const outwards = event.deltaY > 0;
      if (outwards && !event.ctrlKey && this.k <= this.least * 1.001) return; // the page scrolls on
      event.preventDefault();
      const box = this.stage.getBoundingClientRect();
      const unit = event.deltaMode === 1 ? 16 : 1;
      const factor = Math.exp(-Math.max(-100, Math.min(100, event.deltaY * unit)) * (event.ctrlKey ? 0.01 : 0.0025));
      const to = outwards ? Math.max(this.least, this.k * factor) : this.k * factor;
      this.zoomTo(to, event.clientX - box.left, event.clientY - box.top);
    }

    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const commands = { "+": "in", "=": "in", "-": "out", "_": "out", 0: "fit", 1: "actual" };
      const moves = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
      if (event.key in commands) this.command(commands[event.key]);
      else if (event.key in moves && !this.fitted) this.move(...moves[event.key]);
      else return;
      event.preventDefault();
    }

    move(x, y) {
      this.x += x;
      this.y += y;
      this.place();
    }

    listenToPointers() {
      const { stage, pointers } = this;
      let begun = null;
      const send = (name, event) => {
        const detail = document.elementFromPoint(event.clientX, event.clientY);
        this.dispatchEvent(new CustomEvent(name, { detail }));
      };
      stage.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        begun = pointers.size === 1 ? { x: event.clientX, y: event.clientY } : null;
      });
      stage.addEventListener("pointermove", (event) => {
        const before = pointers.get(event.pointerId);
        if (!before) {
          if (event.pointerType !== "touch") send("point", event);
          return;
        }
        const far = begun ? Math.hypot(event.clientX - begun.x, event.clientY - begun.y) > 4 : true;
        if (!far) return;
        begun = null;
        if (!stage.hasPointerCapture(event.pointerId)) stage.setPointerCapture(event.pointerId);
        stage.classList.add("moving");
        const now = { x: event.clientX, y: event.clientY };
        const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
        if (other) this.pinch(before, now, other);
        else this.move(now.x - before.x, now.y - before.y);
        pointers.set(event.pointerId, now);
      });
      const end = (event) => {
        if (!pointers.delete(event.pointerId)) return;
        if (begun && event.type === "pointerup") send("tap", event);
        begun = null;
        if (!pointers.size) stage.classList.remove("moving");
      };
      stage.addEventListener("pointerup", end);
      stage.addEventListener("pointercancel", end);
      stage.addEventListener("pointerleave", () => this.dispatchEvent(new Event("leave")));
      stage.addEventListener("dragstart", (event) => event.preventDefault());
    }

    pinch(before, now, other) {
      const box = this.stage.getBoundingClientRect();
      const apart = (one) => Math.max(1, Math.hypot(one.x - other.x, one.y - other.y));
      const x = (now.x + other.x) / 2 - box.left;
      const y = (now.y + other.y) / 2 - box.top;
      this.x += (now.x - before.x) / 2;
      this.y += (now.y - before.y) / 2;
      this.zoomTo((this.k * apart(now)) / apart(before), x, y);
    }
  }

  const warpsplat = (globalThis.warpsplat ??= {});
  warpsplat.Viewer = Viewer;
  for (const root of document.querySelectorAll(".viewer")) new Viewer(root);
})();
