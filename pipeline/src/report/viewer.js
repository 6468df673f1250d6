// Draws the report's scenes and charts with plotly.js: turning, zooming, hiding layers, cutting with a plane, moving the knee.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const MOST_LEVEL = 9; // names below an axis that have room side by side
  const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i; // what draws where there is no graphics card
  const MOST_LIVE = 3; // browsers give a page only so many WebGL contexts
  const SCALES = {
    distance: [[0, "#2166ac"], [0.25, "#f7f7f7"], [0.6, "#f4a582"], [1, "#b2182b"]],
    mask: [[0, "#e1d5be"], [1, "#1f4fd8"]],
    thickness: "Viridis",
    // sound elements pale, so that the few bad ones are seen
    quality: [[0, "#140014"], [0.02, "#be1428"], [0.2, "#be1428"], [0.3, "#faa050"], [0.49, "#faa050"], [0.5, "#d5dee6"], [1, "#c3d0da"]],
    gap: [[0, "#7f0000"], [0.49, "#fc8d59"], [0.5, "#f7f7f7"], [0.75, "#92c5de"], [1, "#2166ac"]],
    pressure: [[0, "#9cc3e0"], [0.02, "#ffffb2"], [0.25, "#fecc5c"], [0.5, "#fd8d3c"], [0.75, "#f03b20"], [1, "#8e0021"]],
    force: [[0, "#9aa0a6"], [0.02, "#2c7bb6"], [0.5, "#fdae61"], [1, "#d7191c"]],
  };
  const { AXES, bytes, apply, moved, segments, quadEdges, middles, bounds } = geometry;
  const surface = (pool, name) => geometry.surface(data, pool, name), pressures = (...of) => geometry.pressures(data, ...of);
  const SHAPE = [...AXES, "i", "j", "k"];
  const PLANES = ["left to right", "back to front", "bottom to top"];
  // x is the patient's right, y forwards, z up
  const VIEWS = {
    front: { eye: [0, 1, 0], up: [0, 0, 1] },
    behind: { eye: [0, -1, 0], up: [0, 0, 1] },
    "patient's right": { eye: [1, 0, 0], up: [0, 0, 1] },
    "patient's left": { eye: [-1, 0, 0], up: [0, 0, 1] },
    above: { eye: [0, 0, 1], up: [0, 1, 0] },
    below: { eye: [0, 0, -1], up: [0, 1, 0] },
  };
  const DISTANCE = 1.9, VIEW_PX = 384; // the height of a view before it is there (style.css)
  const NO_3D = "This browser has no WebGL, so nothing can be turned here; the still pictures show the same.";
  const opened = [];
  const [dark, paper, calm] = ["(prefers-color-scheme: dark)", "print", "(prefers-reduced-motion: reduce)"].map((asked) => matchMedia(asked));
  const PLAY = calm.matches ? "Next step" : "Play"; // whoever wants less motion gets a step a press
  const colours = () => (dark.matches && !paper.matches ? { ground: "#16181b", ink: "#e6e6e6", line: "#5a606a" } : { ground: "#ffffff", ink: "#222222", line: "#cccccc" });

  const element = (name, attributes = {}, text = "") => {
    const e = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
    e.textContent = text;
    return e;
  };

  // ---- what a layer is to plotly

  function trace(pool, layer, motion) {
    const common = { name: layer.name, visible: layer.on, showlegend: false, hoverinfo: layer.labels ? "text" : "skip", opacity: layer.opacity };
    if (layer.edges) {
      return { ...common, type: "scatter3d", mode: "lines", ...quadEdges(surface(pool, layer.mesh)), line: { color: layer.colour, width: 1.5 }, connectgaps: false };
    }
    if (layer.moves === "names") {
      return { ...common, type: "scatter3d", mode: "text", ...middles(layer.lines), text: layer.labels, textfont: { size: 13, color: colours().ink } };
    }
    if (layer.mesh) {
      const out = { ...common, type: "mesh3d", ...surface(pool, layer.mesh), lighting: { ambient: 0.6, diffuse: 0.6, specular: 0.1, roughness: 0.7 }, lightposition: { x: 3000, y: 6000, z: 6000 } };
      if (layer.presses && motion) {
        const bar = { title: { text: "contact pressure, MPa", side: "right" }, thickness: 12, len: 0.7, x: 0, xanchor: "left" };
        return { ...out, intensity: pressures(pool, layer, null, 1), intensitymode: "vertex", cmin: 0, cmax: mostPressure(motion), colorscale: SCALES.pressure, showscale: layer.presses === "with scale", colorbar: bar };
      }
      if (!layer.scalar) return { ...out, color: layer.colour };
      const { low, high } = layer.scalar;
      const scale = SCALES[layer.scalar.scale];
      const bar = { title: { text: layer.scalar.title, side: "right" }, thickness: 12, len: 0.7, x: 1, xanchor: "right" };
      return {
        ...out, intensity: Float32Array.from(bytes(layer.scalar.values), (b) => low + ((high - low) * b) / 255),
        intensitymode: layer.scalar.cells ? "cell" : "vertex", flatshading: layer.scalar.cells,
        cmin: low, cmax: high, colorscale: scale, showscale: true, colorbar: bar,
      };
    }
    if (layer.lines) {
      const { color, ...xyz } = segments(layer.lines);
      const line = { color: layer.colour, width: 6 };
      if (layer.moves === "fibres" && motion) {
        Object.assign(line, { color, colorscale: SCALES.force, cmin: 0, cmax: mostForce(motion), showscale: true, colorbar: { title: { text: "force of a fibre, N", side: "right" }, thickness: 12, len: 0.7, x: 1, xanchor: "right" } });
      }
      return { ...common, type: "scatter3d", mode: "lines", ...xyz, line, connectgaps: false };
    }
    const [x, y, z] = [0, 1, 2].map((k) => layer.points.map((p) => p[k]));
    return { ...common, type: "scatter3d", mode: "markers", x, y, z, text: layer.labels, marker: { color: layer.colour, size: layer.labels ? 6 : 2 } };
  }

  const mostPressure = (motion) => Math.max(0.1, ...motion.map((m) => m.most_mpa || 0));
  const mostForce = (motion) => Math.max(1, ...motion.flatMap((m) => m.steps.flatMap((s) => s.force)));

  // ---- a scene

  class View {
    /** Place, middle and upward direction of the eye. @type {number[]} */
    eye = [];
    /** @type {number[]} */
    middle = [];
    /** @type {number[]} */
    up = [];

    constructor(figure) {
      this.figure = figure;
      const [pool, id] = figure.dataset.scene.split("/");
      this.pool = pool;
      this.id = id;
      this.scene = data[this.pool].scenes.find((s) => s.id === this.id);
      this.motion = this.scene.moves ? data[this.pool].motions : null;
      this.traces = this.scene.layers.map((l) => trace(this.pool, l, this.motion));
      this.box = bounds(this.traces, this.motion);
      this.size = Math.max(...AXES.map((_, k) => this.box.high[k] - this.box.low[k]));
      const shown = bounds(this.traces.filter((t) => t.visible), null);
      this.focus = {
        middle: [0, 1, 2].map((k) => (1.35 * ((shown.low[k] + shown.high[k]) - (this.box.low[k] + this.box.high[k]))) / (2 * this.size)),
        share: Math.max(...AXES.map((_, k) => shown.high[k] - shown.low[k])) / this.size,
      };
      this.cut = { axis: -1, share: 0.5, far: false };
      this.rough = this.wasRough = 0; // mean edges of a surface that are drawn as one; 0 as it is
      this.drafting = false;
      this.byProcessor = byProcessor;
      this.look(this.scene.from);
      this.queue = Promise.resolve();
      this.build();
    }

    build() {
      this.frame = element("div", { class: "view", role: "application", tabindex: "0", "aria-label": `${this.scene.title}: 3D view. Arrow keys turn it, plus and minus zoom, 0 turns it back.`, "aria-describedby": `text-${this.pool}-${this.id}` });
      this.plot = element("div", { class: "plot" });
      this.frame.append(this.plot);
      this.tools = element("div", { class: "tools" });
      this.figure.querySelector(".still").after(this.tools, this.frame);
      this.figure.classList.add("live");
      this.buttons();
      this.layers();
      this.plane();
      if (this.motion && this.id !== "live") this.slider();
      this.frame.addEventListener("keydown", (e) => this.key(e));
      // the page scrolls under the wheel until the view is chosen
      this.frame.addEventListener("wheel", (e) => { if (!this.frame.contains(document.activeElement)) e.stopPropagation(); }, { capture: true });
      this.frame.addEventListener("pointerdown", () => this.frame.focus({ preventScroll: true }));
      const axis = (k) => ({ visible: false, showspikes: false, autorange: false, range: [this.box.low[k], this.box.high[k]] });
      const layout = {
        margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: colours().ground, font: { color: colours().ink }, uirevision: "kept",
        scene: { xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), aspectmode: "manual", aspectratio: this.ratio(), camera: this.camera(), dragmode: "orbit" },
      };
      this.queue = Plotly.newPlot(this.plot, this.traces, layout, { responsive: true, displaylogo: false, displayModeBar: false, scrollZoom: true }).then(() => {
        this.plot.on("plotly_relayout", (e) => { if (e["scene.camera"]) this.took(e["scene.camera"]); });
        if (this.plot.querySelector(".no-webgl")) return this.close(NO_3D);
        const canvas = this.plot.querySelector("canvas");
        if (canvas) canvas.setAttribute("aria-hidden", "true");
        this.figure.dataset.ready = "yes";
        if (this.which) this.move();
        this.figure.dispatchEvent(new CustomEvent("shown", { detail: this }));
      }, () => this.close(NO_3D));
    }

    // one change at a time; of changes of a kind that wait only the last is made
    later(kind, change) {
      this.waiting = this.waiting || {};
      const first = !(kind in this.waiting);
      this.waiting[kind] = change;
      if (!first) return;
      this.figure.dataset.busy = "yes";
      this.queue = this.queue.then(() => {
        const last = this.waiting[kind];
        delete this.waiting[kind];
        return this.closed ? null : last();
      });
      const mine = this.queue;
      mine.then(() => { if (this.queue === mine) delete this.figure.dataset.busy; });
    }

    // -- camera: eye and middle are kept for the uncut box; plotly's are for the box that the cut leaves

    look(name) {
      const v = VIEWS[name];
      this.middle = [...this.focus.middle];
      // plotly.js sees 45 deg from bottom to top: a picture higher than it is wide sees less from side to side
      const { clientWidth: wide, clientHeight: high } = this.plot || this.figure;
      const narrow = Math.max(1, Math.min(2, (this.plot ? high : VIEW_PX) / (wide || VIEW_PX)));
      this.eye = v.eye.map((c, k) => this.middle[k] + c * DISTANCE * narrow * Math.max(0.3, this.focus.share));
      this.up = [...v.up];
    }

    range() {
      const { low, high } = this.box, c = this.cut;
      return [0, 1, 2].map((k) => {
        if (k !== c.axis) return [low[k], high[k]];
        const at = low[k] + Math.min(0.99, Math.max(0.01, c.share)) * (high[k] - low[k]);
        return c.far ? [at, high[k]] : [low[k], at];
      });
    }

    ratio() {
      const r = this.range().map(([a, b]) => (1.35 * (b - a)) / this.size);
      return { x: r[0], y: r[1], z: r[2] };
    }

    shift() {
      return this.range().map(([a, b], k) => (1.35 * ((a + b) / 2 - (this.box.low[k] + this.box.high[k]) / 2)) / this.size);
    }

    camera() {
      const s = this.shift();
      const vector = (v) => ({ x: v[0], y: v[1], z: v[2] });
      return { eye: vector(this.eye.map((c, k) => c - s[k])), center: vector(this.middle.map((c, k) => c - s[k])), up: vector(this.up) };
    }

    took(camera) {
      const s = this.shift();
      const list = (v) => [v.x, v.y, v.z];
      this.eye = list(camera.eye).map((c, k) => c + s[k]);
      this.middle = list(camera.center).map((c, k) => c + s[k]);
      this.up = list(camera.up);
    }

    aim() {
      this.later("aim", () => Plotly.relayout(this.plot, { "scene.camera": this.camera() }));
    }

    turn(right, up) {
      const d = this.eye.map((c, k) => c - this.middle[k]);
      const about = (v, axis, angle) => {
        const [c, s] = [Math.cos(angle), Math.sin(angle)], n = Math.hypot(...axis), u = axis.map((a) => a / n);
        const dot = v[0] * u[0] + v[1] * u[1] + v[2] * u[2];
        const cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        return v.map((a, k) => a * c + cross[k] * s + u[k] * dot * (1 - c));
      };
      const side = [this.up[1] * d[2] - this.up[2] * d[1], this.up[2] * d[0] - this.up[0] * d[2], this.up[0] * d[1] - this.up[1] * d[0]];
      const turned = about(about(d, this.up, -right), side, -up);
      this.up = about(this.up, side, -up);
      this.eye = turned.map((c, k) => c + this.middle[k]);
      this.aim();
    }

    zoom(factor) {
      this.eye = this.eye.map((c, k) => this.middle[k] + (c - this.middle[k]) * factor);
      this.aim();
    }

    key(e) {
      const step = 0.12;
      const does = {
        ArrowLeft: () => this.turn(-step, 0), ArrowRight: () => this.turn(step, 0), ArrowUp: () => this.turn(0, step), ArrowDown: () => this.turn(0, -step),
        "+": () => this.zoom(0.9), "=": () => this.zoom(0.9), "-": () => this.zoom(1.1), 0: () => { this.look(this.scene.from); this.aim(); },
      }[e.key];
      if (does) { e.preventDefault(); does(); }
    }

    // -- controls

    buttons() {
      const group = element("div", { role: "group", "aria-label": "Look from" });
      const act = (words, does, attributes = {}) => {
        const b = element("button", { type: "button", ...attributes }, words);
        b.addEventListener("click", does);
        group.append(b);
      };
      Object.keys(VIEWS).forEach((name) => act(name, () => { this.look(name); this.aim(); }));
      if (this.figure.querySelector(".still").childElementCount) act("Still pictures", () => { this.close(""); this.figure.dataset.shut = "yes"; }, { class: "shut" });
      act("Save PNG", () => Plotly.downloadImage(this.plot, { format: "png", scale: 3, filename: this.id }));
      this.tools.append(group);
    }

    layers() {
      const set = element("fieldset", { class: "layers" });
      set.append(element("legend", {}, "Layers"));
      this.boxes = this.scene.layers.map((layer, n) => {
        const label = element("label");
        const box = element("input", { type: "checkbox" });
        box.checked = layer.on;
        box.addEventListener("change", () => this.show(n, box.checked));
        label.append(box, " " + layer.name);
        set.append(label);
        return box;
      });
      this.tools.append(set);
    }

    show(n, on) {
      const kind = this.scene.layers[n].one_of;
      this.scene.layers.forEach((l, m) => { if (on && kind && m !== n && l.one_of === kind) this.boxes[m].checked = false; });
      this.later("layers", () => Plotly.restyle(this.plot, { visible: this.boxes.map((b) => b.checked) }));
    }

    plane() {
      const set = element("fieldset", { class: "cut" });
      set.append(element("legend", {}, "Cut with a plane"));
      const which = element("select", { "aria-label": "Direction of the cut" });
      ["no cut", ...PLANES].forEach((words, k) => which.append(element("option", { value: k - 1 }, words)));
      const where = element("input", { type: "range", min: 0, max: 100, value: 50, "aria-label": "Place of the cut, per cent of the way", disabled: "" });
      const far = element("input", { type: "checkbox" });
      const label = element("label");
      label.append(far, " other half");
      const change = () => {
        this.cut = { axis: Number(which.value), share: where.value / 100, far: far.checked };
        where.disabled = this.cut.axis < 0;
        const r = this.range();
        this.later("cut", () => Plotly.relayout(this.plot, {
          "scene.xaxis.range": r[0], "scene.yaxis.range": r[1], "scene.zaxis.range": r[2], "scene.aspectratio": this.ratio(), "scene.camera": this.camera(),
        }));
      };
      [which, where, far].forEach((c) => c.addEventListener("input", change));
      set.append(which, where, label);
      this.tools.append(set);
    }

    slider() {
      const set = element("fieldset", { class: "motion" });
      set.append(element("legend", {}, "Motion"));
      this.which = element("select", { "aria-label": "Which motion" });
      this.motion.forEach((m, n) => this.which.append(element("option", { value: n }, m.name)));
      this.at = element("input", { type: "range", min: 0, value: 0, "aria-label": "Step of the motion" });
      this.step = element("p", { class: "step", "aria-live": "polite" });
      this.which.addEventListener("input", () => { this.at.value = 0; this.overlay(); this.move(); });
      this.at.addEventListener("input", () => { this.halt(); this.move(); });
      this.play = element("button", { type: "button", class: "play", ...(calm.matches ? {} : { "aria-pressed": "false" }) }, PLAY);
      this.play.addEventListener("click", () => (calm.matches ? this.forward() : this.ticks ? this.halt() : this.run()));
      const map = element("button", { type: "button", class: "map" }, "Pressure on the tibia");
      map.addEventListener("click", () => this.uncover());
      set.append(this.which, this.at, this.play);
      if (this.scene.layers.some((l) => l.presses)) set.append(map);
      this.tools.append(set, this.step);
    }

    run() {
      this.play.textContent = "Stop";
      this.play.setAttribute("aria-pressed", "true");
      this.step.setAttribute("aria-live", "off");
      this.ticks = setInterval(() => { if (this.closed) this.halt(); else if (!this.figure.dataset.busy) this.forward(); }, 150);
    }

    forward() { this.at.value = (Number(this.at.value) + 1) % (Number(this.at.max) + 1); this.move(); }

    halt() {
      if (!this.ticks) return;
      clearInterval(this.ticks);
      this.ticks = null;
      this.play.textContent = PLAY;
      this.play.setAttribute("aria-pressed", "false");
      this.step.setAttribute("aria-live", "polite");
    }

    // the measured pose is shown where the motion has one
    overlay() {
      const there = this.motion[Number(this.which.value)].steps.some((s) => s.measured);
      this.scene.layers.forEach((l, n) => { if (l.moves === "measured") this.boxes[n].checked = there; });
      this.later("layers", () => Plotly.restyle(this.plot, { visible: this.boxes.map((b) => b.checked) }));
    }

    // the femur out of the way, from above; again, and it is back
    uncover() {
      const femur = this.scene.layers.flatMap((l, n) => (l.moves === "femur" || l.moves === "measured" || l.moves === "fibres" || l.moves === "names" || l.name === "patella" ? [n] : []));
      const back = femur.every((n) => !this.boxes[n].checked);
      femur.forEach((n) => { this.boxes[n].checked = back && this.scene.layers[n].on; });
      this.later("layers", () => Plotly.restyle(this.plot, { visible: this.boxes.map((b) => b.checked) }));
      this.look(back ? this.scene.from : "above");
      this.aim();
    }

    move() {
      const motion = this.motion[Number(this.which.value)];
      this.at.max = motion.steps.length - 1;
      const step = motion.steps[Number(this.at.value)];
      this.step.textContent = step.label;
      this.at.setAttribute("aria-valuetext", step.label);
      this.place(step, motion.most_mpa);
    }

    // the femur, the fibres and the pressures of a step; the colours' ends grow with what a live knee bears
    place(step, high) {
      this.femur = step.femur;
      const most = this.most || { n: mostForce(this.motion), mpa: mostPressure(this.motion) };
      this.most = { n: Math.max(most.n, ...step.force), mpa: Math.max(most.mpa, ...Object.values(step.pressed || {}).flat().map((p) => p[1])) };
      const grown = !this.placedOnce || most.n !== this.most.n || most.mpa !== this.most.mpa;
      this.placedOnce = true;
      const reshaped = this.rough !== this.wasRough;
      this.wasRough = this.rough;
      this.last = [step, high];
      const changes = this.scene.layers.flatMap((layer, n) => {
        const shape = reshaped && this.reshapes(layer) ? this.shape(layer) : {};
        if (!layer.moves && !layer.presses && !shape.i) return [];
        const at = layer.moves ? this.placed(layer, step) : {}, fibres = layer.moves === "fibres";
        const pressure = layer.presses ? { intensity: this.pressed(layer, step, high), cmax: this.most.mpa } : {};
        return [[n, { ...shape, ...at, ...pressure, "line.color": "color" in at ? at.color : undefined, "line.cmax": fibres ? this.most.n : undefined }]];
      });
      this.later("move", () => (!grown && this.redrawn(changes)) || this.restyled(changes));
    }

    // one change of all: what a layer does not have is left as it is
    restyled(changes) {
      const keys = [...SHAPE, "line.color", "line.cmax", "intensity", "cmax"];
      return Plotly.restyle(this.plot, Object.fromEntries(keys.map((key) => [key, changes.map(([, own]) => own[key])])), changes.map(([n]) => n));
    }

    // the layers that changed and no others: plotly.js hands every surface to the graphics card again. False where it must look at all itself
    redrawn(changes) {
      const scene = (this.plot._fullLayout.scene || {})._scene, full = this.plot._fullData;
      // plotly.js has no points of a layer that was never shown; it takes them from the data when it is
      const isShown = (n) => full[n].visible === true;
      if (!scene || !scene.traces || !scene.glplot || changes.some(([n, own]) => isShown(n) && own.x && !own.i && own.x.length !== full[n].x.length)) return false;
      for (const [n, own] of changes) {
        for (const trace of isShown(n) ? [full[n], this.plot.data[n]] : [this.plot.data[n]]) {
          for (const key of [...SHAPE, "intensity"]) if (own[key]) trace[key] = own[key];
          if (own["line.color"]) trace.line.color = own["line.color"];
        }
        const drawn = scene.traces[full[n].uid];
        if (drawn && isShown(n)) drawn.update(full[n]);
      }
      // plotly.js draws all once more to know what lies under the pointer, and waits for it; the live view knows it by itself. Once that picture is blank
      for (const drawn of scene.glplot.objects) {
        drawn.drawPick = null;
        if (this.unpicked) drawn.dirty = false;
      }
      this.unpicked = true;
      scene.glplot.redraw();
      return true;
    }

    // the picture anew, as where its surfaces have other corners than before
    again() {
      if (this.rough !== this.wasRough && this.last) this.place(...this.last);
      else this.plot._fullLayout.scene._scene.glplot.redraw();
    }

    // the surface of a layer, of fewer corners where that is enough
    shape(layer) {
      const full = surface(this.pool, layer.mesh);
      if (!this.rough || !this.reshapes(layer)) return full;
      this.fewer = this.fewer || new Map();
      if (!this.fewer.has(layer.mesh)) this.fewer.set(layer.mesh, geometry.coarse(full, this.rough));
      return this.fewer.get(layer.mesh);
    }

    reshapes(layer) { return layer.mesh && !layer.edges && !layer.scalar; }

    pressed(layer, step, high) {
      const all = pressures(this.pool, layer, step, high), { of } = this.shape(layer);
      return of ? Float32Array.from(of, (n) => all[n]) : all;
    }

    placed(layer, step) {
      if (layer.moves === "femur") return moved(this.shape(layer), step.femur);
      if (layer.moves === "measured") return moved(this.shape(layer), step.measured || step.femur);
      if (layer.moves === "names") return middles(layer.lines, step.femur);
      const lines = [...layer.lines, ...(step.grafts || [])];
      this.ends = lines.map((p, n) => (n % 2 ? p : apply(p, step.femur)));
      return segments(lines, step.femur, step.force, step.cut);
    }

    // the surface of a layer as it was placed last
    solid(n) {
      const layer = this.scene.layers[n], s = surface(this.pool, layer.mesh);
      return this.femur && (layer.moves === "femur" || layer.moves === "measured") ? { ...s, ...moved(s, this.femur) } : s;
    }

    close(words) {
      this.closed = true;
      clearInterval(this.ticks || undefined);
      Plotly.purge(this.plot);
      this.tools.remove();
      this.frame.remove();
      this.figure.classList.remove("live");
      delete this.figure.dataset.ready;
      opened.splice(opened.indexOf(this), 1);
      if (words) this.figure.querySelector(":scope > figcaption").append(" " + words);
      this.figure.querySelector(".open").hidden = false;
    }
  }

  // without WebGL the stills stay: plotly would put a slab of words in their place
  const [drawsIn3d, byProcessor] = (() => {
    try {
      const gl = document.createElement("canvas").getContext("webgl"), names = gl && gl.getExtension("WEBGL_debug_renderer_info");
      const drawer = names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "", lose = gl && gl.getExtension("WEBGL_lose_context");
      if (lose) lose.loseContext();
      return [Boolean(gl), SOFTWARE.test(drawer)];
    } catch { return [false, false]; }
  })();
  // plotly.js draws two pixels each way for one of the screen, which smooths edges already. It has them smoothed besides, which takes a processor half its time
  if (byProcessor) {
    const { getContext } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = /** @type {any} */ (function (kind, given) {
      return getContext.call(this, kind, given && kind.startsWith("webgl") ? { ...given, antialias: false } : given);
    });
  }

  function open(figure) {
    if (opened.some((v) => v.figure === figure)) return;
    while (opened.length >= MOST_LIVE) opened[0].close("");
    figure.querySelector(".open").hidden = true;
    opened.push(new View(figure));
  }

  // ---- charts

  function draw(chart) {
    if (chart.dataset.ready) return;
    chart.dataset.ready = "yes";
    const [pool, id] = chart.dataset.chart.split("/");
    const plot = data[pool].charts[id];
    const c = colours();
    const axis = (a) => ({ ...a, automargin: true, gridcolor: c.line, linecolor: c.line, zerolinecolor: c.line });
    const narrow = chart.clientWidth < 480;
    // many names run down to the left: to the right the last would be cut
    const names = new Set(plot.data.flatMap((d) => d.x || []).filter((x) => typeof x === "string"));
    const slant = names.size > MOST_LEVEL ? { tickangle: -45 } : {};
    const legend = narrow ? { orientation: "h", y: -0.35, font: { size: 10 } } : {};
    const layout = { ...plot.layout, xaxis: { ...axis(plot.layout.xaxis), ...slant }, yaxis: axis(plot.layout.yaxis), legend: { ...plot.layout.legend, ...legend }, margin: { l: narrow ? 45 : 60, r: 10, t: 10, b: 60 }, paper_bgcolor: c.ground, plot_bgcolor: c.ground, font: { color: c.ink }, height: undefined };
    Plotly.newPlot(chart, plot.data, layout, { responsive: true, displaylogo: false, displayModeBar: false });
    if (!chart.nextElementSibling || !chart.nextElementSibling.classList.contains("save")) {
      const save = element("div", { class: "save" });
      for (const format of ["svg", "png"]) {
        const b = element("button", { type: "button" }, "Save " + format.toUpperCase());
        b.addEventListener("click", () => Plotly.downloadImage(chart, { format, scale: format === "png" ? 3 : 1, filename: id }));
        save.append(b);
      }
      chart.after(save);
    }
    // on paper a chart takes the room there is, whole
    const shape = () => chart.querySelectorAll(".main-svg").forEach((svg) => {
      const [width, height] = [svg.getAttribute("width"), svg.getAttribute("height")];
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      chart.style.setProperty("--shape", `${width} / ${height}`);
    });
    shape();
    chart.on("plotly_afterplot", shape);
  }

  // ---- the page

  const seen = new IntersectionObserver((entries) => {
    for (const e of entries) {
      const on = e.isIntersecting, at = /** @type {any} */ (e.target);
      if (at.dataset.chart) { if (on) draw(at); continue; }
      clearTimeout(at.waits);
      if (on && !at.dataset.shut) at.waits = setTimeout(() => open(at), 150);
    }
  }, { rootMargin: "50px" });
  document.querySelectorAll("[data-scene]").forEach((figure, n) => {
    if (!drawsIn3d) {
      if (n === 0) figure.querySelector(":scope > figcaption").append(" " + NO_3D);
      return;
    }
    const button = element("button", { type: "button", class: "open" }, "Show in 3D");
    button.addEventListener("click", () => { delete figure.dataset.shut; open(figure); });
    figure.querySelector(".still").after(button);
    seen.observe(figure);
  });
  document.querySelectorAll("[data-chart]").forEach((chart) => seen.observe(chart));
  const again = () => {
    document.querySelectorAll("[data-chart]").forEach((chart) => {
      if (!chart.dataset.ready) return;
      delete chart.dataset.ready;
      draw(chart);
    });
    const c = colours();
    opened.forEach((v) => v.later("ground", () => Plotly.relayout(v.plot, { paper_bgcolor: c.ground, "font.color": c.ink })));
    opened.forEach((v) => {
      const names = v.scene.layers.flatMap((l, n) => (l.moves === "names" ? [n] : []));
      if (names.length) v.later("ink", () => Plotly.restyle(v.plot, { "textfont.color": c.ink }, names));
    });
  };
  dark.addEventListener("change", again);
  paper.addEventListener("change", again);
  // paper has one page alone, for whoever has no time for more, unless the whole report is asked for
  document.querySelectorAll("button.print").forEach((button) => {
    button.hidden = false;
    button.addEventListener("click", () => {
      document.body.classList.toggle("whole", "whole" in button.dataset);
      window.addEventListener("afterprint", () => document.body.classList.remove("whole"), { once: true });
      window.print();
    });
  });
  window.addEventListener("beforeprint", () => document.querySelectorAll("[data-chart]").forEach(draw));
  // one page on paper: what is too long for it is set smaller, and never cut. It is measured out of sight: a browser that prints waits for nobody
  const PAPER_MM = 188, LEAST_FIT = 0.6; // the width of A4 within the margins of style.css; below that nobody could read it
  window.addEventListener("load", () => {
    const sheet = document.querySelector(".sheet");
    if (!sheet) return;
    Object.assign(sheet.style, { display: "flex", position: "absolute", visibility: "hidden", width: `${PAPER_MM}mm` });
    const share = sheet.clientHeight / sheet.scrollHeight;
    sheet.removeAttribute("style");
    if (share < 1) sheet.style.setProperty("--fit", Math.max(LEAST_FIT, 0.98 * share));
  });

  // the paper's figures are SVG already; a PNG is drawn from it
  document.querySelectorAll("[data-svg]").forEach((figure) => {
    const image = figure.querySelector("img"), name = figure.dataset.svg;
    const save = element("div", { class: "save" });
    const link = (url, end) => { const a = element("a", { href: url, download: `${name}.${end}` }); a.click(); };
    const svg = element("button", { type: "button" }, "Save SVG");
    svg.addEventListener("click", () => link(image.src, "svg"));
    const png = element("button", { type: "button" }, "Save PNG");
    png.addEventListener("click", () => {
      const canvas = element("canvas");
      [canvas.width, canvas.height] = [3 * image.naturalWidth, 3 * image.naturalHeight];
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      link(canvas.toDataURL("image/png"), "png");
    });
    save.append(svg, png);
    image.after(save);
  });
})();
