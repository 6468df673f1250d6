// The pointer on the live knee: where it points at, what a pull at the tibia means as a load, what a click means.
"use strict";
const liveHand = (() => {
  const FOV = Math.PI / 4; // plotly.js's perspective, from bottom to top [rad]
  const N_PER_MM = 2; // a pull by a third of the picture is a Lachman test [N/mm]; ours
  const STILL_PX = 4; // a pointer that moves no further has clicked
  /** @type {Record<string, number>} */
  const NEAR_PX = { mouse: 7, pen: 9, touch: 14 }; // so near to a fibre it is meant
  const BEHIND_MM = 6; // a fibre so far behind a bone's face is hidden
  /** @type {(a: Triple, b: Triple) => number} */
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  /** @type {(a: Triple, b: Triple) => Triple} */
  const less = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  /** @type {(a: Triple, b: Triple) => Triple} */
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  /** @type {(a: Triple) => Triple} */
  const unit = (a) => { const n = Math.hypot(...a); return [a[0] / n, a[1] / n, a[2] / n]; };
  /** @type {(a: Triple, b: Triple, by: number) => Triple} */
  const more = (a, b, by) => [a[0] + by * b[0], a[1] + by * b[1], a[2] + by * b[2]];

  /** The camera of a view: its axes in the picture, its place, and its scale, in the page's axes [mm]. @type {(view: LiveView) => { eye: Triple, ahead: Triple, right: Triple, up: Triple, box: DOMRect, focal: number }} */
  function camera(view) {
    const scale = 1.35 / view.size, { low, high } = view.box;
    /** @type {Triple} */
    const middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
    const ahead = unit(less(view.middle, view.eye)), right = unit(cross(ahead, view.up)), up = cross(right, ahead);
    const box = view.plot.getBoundingClientRect();
    return { eye: more(middle, view.eye, 1 / scale), ahead, right, up, box, focal: box.height / 2 / Math.tan(FOV / 2) };
  }

  /** A point in pixels of the view, and how far ahead it lies [mm]. @type {(view: LiveView, p: Triple) => { x: number, y: number, depth: number }} */
  function project(view, p) {
    const c = camera(view), d = less(p, c.eye), depth = dot(d, c.ahead);
    return { x: c.box.width / 2 + (c.focal * dot(d, c.right)) / depth, y: c.box.height / 2 - (c.focal * dot(d, c.up)) / depth, depth };
  }

  /** @type {(view: LiveView, x: number, y: number) => LiveRay} */
  function ray(view, x, y) {
    const c = camera(view);
    return { from: c.eye, along: more(more(c.ahead, c.right, (x - c.box.width / 2) / c.focal), c.up, (c.box.height / 2 - y) / c.focal) };
  }

  /** How far along a ray its first triangle lies [-]. @type {(ray: LiveRay, s: LiveSurface, inside: (p: Triple) => boolean) => number} */
  function first({ from, along }, s, inside) {
    let best = Infinity;
    /** @type {(n: number) => Triple} */
    const corner = (n) => [s.x[n], s.y[n], s.z[n]];
    for (let t = 0; t < s.i.length; t++) {
      const a = corner(s.i[t]), e = less(corner(s.j[t]), a), g = less(corner(s.k[t]), a);
      const q = cross(along, g), det = dot(e, q);
      if (Math.abs(det) < 1e-9) continue;
      const d = less(from, a), u = dot(d, q) / det;
      if (u < 0 || u > 1) continue;
      const r = cross(d, e), v = dot(along, r) / det, far = dot(g, r) / det;
      if (v >= 0 && u + v <= 1 && far > 0 && far < best && inside(more(from, along, far))) best = far;
    }
    return best;
  }

  /** @type {(name: string) => string} */
  const boneOf = (name) => (name.includes("femur") ? "femur" : name.includes("tib") ? "tibia" : name);

  /** The bone under a pixel, with the place on it. @type {(view: LiveView, x: number, y: number) => LiveBone | null} */
  function bone(view, x, y) {
    const line = ray(view, x, y), range = view.range();
    /** @type {(p: Triple) => boolean} */
    const inside = (p) => p.every((v, k) => v >= range[k][0] && v <= range[k][1]);
    let best = { far: Infinity, name: "" };
    view.scene.layers.forEach((layer, n) => {
      if (!layer.mesh || layer.edges || !view.boxes[n].checked) return;
      const far = first(line, view.solid(n), inside);
      if (far < best.far) best = { far, name: boneOf(layer.name) };
    });
    return best.name ? { name: best.name, point: more(line.from, line.along, best.far), depth: project(view, more(line.from, line.along, best.far)).depth } : null;
  }

  /** The number of the fibre under a pixel, unless a bone hides it. @type {(view: LiveView, x: number, y: number, kind: string, hit: LiveBone | null) => number} */
  function fibre(view, x, y, kind, hit) {
    const n = view.scene.layers.findIndex((l) => l.moves === "fibres");
    if (n < 0 || !view.boxes[n].checked || !view.ends) return -1;
    let best = { far: NEAR_PX[kind] || NEAR_PX.mouse, number: -1 };
    for (let f = 0; 2 * f < view.ends.length; f++) {
      const [a, b] = [view.ends[2 * f], view.ends[2 * f + 1]].map((p) => project(view, p));
      const [dx, dy] = [b.x - a.x, b.y - a.y], t = Math.min(1, Math.max(0, ((x - a.x) * dx + (y - a.y) * dy) / (dx * dx + dy * dy || 1)));
      const far = Math.hypot(x - a.x - t * dx, y - a.y - t * dy), depth = a.depth + t * (b.depth - a.depth);
      if (far < best.far && (!hit || depth < hit.depth + BEHIND_MM)) best = { far, number: f };
    }
    return best.number;
  }

  /** A pull by pixels at a place on the tibia: force [N] and its moment about the knee's middle [N m], in the page's axes. @type {(view: LiveView, at: Triple, dx: number, dy: number) => LivePull} */
  function pull(view, at, dx, dy) {
    const c = camera(view), mm = project(view, at).depth / c.focal;
    const force = more(more([0, 0, 0], c.right, dx * mm * N_PER_MM), c.up, -dy * mm * N_PER_MM);
    return { force, moment: more([0, 0, 0], cross(at, force), 1 / 1000) };
  }

  // ---- the arrow

  const SVG = "http://www.w3.org/2000/svg";
  class Arrow {
    /** @param {LiveView} view */
    constructor(view) {
      this.view = view;
      const make = (/** @type {string} */ name, /** @type {Record<string, string>} */ attributes) => { const e = document.createElementNS(SVG, name); for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v); return e; };
      this.svg = make("svg", { class: "live-arrow", "aria-hidden": "true" });
      this.line = make("path", { class: "shaft" });
      this.words = make("text", {});
      this.svg.append(this.line, this.words);
      view.frame.append(this.svg);
    }

    /** From a place by a force, drawn as long as the pull that makes it. @type {(at: Triple, force: Triple, words: string) => void} */
    show(at, force, words) {
      const a = project(this.view, at), b = project(this.view, more(at, force, 1 / N_PER_MM)), long = Math.hypot(b.x - a.x, b.y - a.y) || 1;
      const [ux, uy] = [(b.x - a.x) / long, (b.y - a.y) / long], head = Math.min(12, long / 2);
      const side = (/** @type {number} */ s) => `${b.x - head * (ux + 0.5 * s * uy)},${b.y - head * (uy - 0.5 * s * ux)}`;
      this.line.setAttribute("d", `M${a.x},${a.y}L${b.x},${b.y}M${side(1)}L${b.x},${b.y}L${side(-1)}`);
      const width = this.svg.clientWidth, left = b.x > width / 2;
      this.words.setAttribute("x", String(Math.min(width - 4, Math.max(4, b.x + (left ? -14 : 14)))));
      this.words.setAttribute("y", String(Math.min(this.svg.clientHeight - 6, Math.max(16, b.y - 10))));
      this.words.setAttribute("text-anchor", left ? "end" : "start");
      this.words.textContent = words;
    }

    remove() { this.svg.remove(); }
  }

  // ---- the pointer

  /** What a hand does. `way` is "pull", "turn" or none; `pulled` gives what is borne and its words; `ended` is told whether it is kept.
   * @param {LiveView} view
   * @param {{ way: () => string, placing: () => boolean, began: () => void, pulled: (load: LivePull, turns: boolean) => { force: Triple, words: string }, ended: (kept: boolean) => void, clicked: (at: { fibre: number, bone: LiveBone | null }) => void }} does */
  function attach(view, does) {
    /** @type {{ id: number, from: [number, number], to: [number, number], at: LiveBone | null, grips: boolean, turns: boolean, moves: boolean, turned?: boolean, arrow?: Arrow } | null} */
    let hand = null;
    let waits = 0;
    /** @type {(e: PointerEvent) => [number, number]} */
    const place = (e) => { const box = view.plot.getBoundingClientRect(); return [e.clientX - box.left, e.clientY - box.top]; };
    const draw = () => {
      waits = 0;
      if (!hand || !hand.at || !hand.arrow) return;
      const load = pull(view, hand.at.point, hand.to[0] - hand.from[0], hand.to[1] - hand.from[1]);
      const { force, words } = does.pulled(load, hand.turns);
      hand.arrow.show(hand.at.point, force, words);
      view.figure.dataset.arrow = words;
    };
    const end = (/** @type {boolean} */ kept) => {
      cancelAnimationFrame(waits);
      waits = 0;
      const arrow = hand && hand.arrow;
      hand = null;
      if (!arrow) return;
      arrow.remove();
      delete view.figure.dataset.arrow;
      does.ended(kept);
    };
    const hold = (/** @type {Event} */ e) => { if (hand && hand.grips) { e.stopPropagation(); if (e.cancelable) e.preventDefault(); } };
    view.frame.addEventListener("pointerdown", (e) => {
      if (e.button !== 0 || hand || !e.isPrimary) return;
      const from = place(e), at = bone(view, ...from), way = does.way();
      const grips = Boolean(way && at && at.name === "tibia" && !does.placing());
      hand = { id: e.pointerId, from, to: from, at, grips, turns: (way === "turn") !== e.shiftKey, moves: false };
      if (!grips) return;
      // the camera does not turn with a pull
      e.preventDefault();
      e.stopPropagation();
      view.frame.focus({ preventScroll: true });
      view.frame.setPointerCapture(e.pointerId);
    }, { capture: true });
    view.frame.addEventListener("pointermove", (e) => {
      if (!hand || e.pointerId !== hand.id) return;
      hand.to = place(e);
      if (!hand.moves && Math.hypot(hand.to[0] - hand.from[0], hand.to[1] - hand.from[1]) <= STILL_PX) return;
      if (!hand.grips) { hand.turned = true; return; }
      hold(e);
      if (!hand.moves) { hand.moves = true; hand.arrow = new Arrow(view); does.began(); }
      if (!waits) waits = requestAnimationFrame(draw);
    }, { capture: true });
    view.frame.addEventListener("pointerup", (e) => {
      if (!hand || e.pointerId !== hand.id) return;
      hold(e);
      const { moves, turned, at, from } = hand;
      if (moves && waits) { cancelAnimationFrame(waits); draw(); }
      end(true);
      if (!moves && !turned) does.clicked({ bone: at, fibre: fibre(view, ...from, e.pointerType, at) });
    }, { capture: true });
    view.frame.addEventListener("pointercancel", () => { if (hand) end(false); }, { capture: true });
    for (const name of ["mousedown", "mousemove", "touchstart", "touchmove"]) view.frame.addEventListener(name, hold, { capture: true, passive: false });
    document.addEventListener("keydown", (e) => { if (e.key === "Escape" && hand && hand.moves) { e.preventDefault(); end(false); } });
  }

  return { attach, project, bone, fibre, pull };
})();
