// The knee in the reader's hands: what is asked, the workers that solve it, and the answer in words, tables and the picture.
"use strict";
(() => {
  const section = document.getElementById("live");
  if (!section) return;
  // loads act on the tibia; least, most and step of the sliders are ours: as far as clinical tests go. A number that is typed or linked goes as far as
  // `taken`, as a plan's tests do; a flexion as far as the solver takes it
  /** @type {LiveSlider[]} */
  const SLIDERS = [
    { key: "flexion", words: "Flexion", unit: "deg", least: 0, most: 120, step: 1 },
    { key: "ap", words: "Pull forwards (below 0: push backwards)", unit: "N", least: -200, most: 200, step: 1, taken: [-500, 500] },
    { key: "ie", words: "Twist outwards (below 0: inwards)", unit: "N m", least: -12, most: 12, step: 0.1, taken: [-50, 50] },
    { key: "vv", words: "Valgus bend (below 0: varus)", unit: "N m", least: -15, most: 15, step: 0.1, taken: [-50, 50] },
    { key: "ml", words: "Push to the outer side (below 0: inner)", unit: "N", least: -100, most: 100, step: 1, taken: [-500, 500] },
    { key: "si", words: "Compression", unit: "N", least: 0, most: 500, step: 1, taken: [0, 3000] },
  ];
  const COMPRESSION_N = 20; // as in the measured tests and the protocols
  const REST = { flexion: 30, vv: 0, ie: 0, ml: 0, ap: 0, si: COMPRESSION_N };
  // 133 N, 8 and 4 N m: the protocols of the validation; 5 N m for the dial test and 10 N m for the stress tests are ours
  const PRESETS = {
    "At rest": { flexion: 30 }, Lachman: { flexion: 30, ap: 133 },
    "Anterior drawer, 90 deg": { flexion: 90, ap: 133 }, "Posterior drawer, 90 deg": { flexion: 90, ap: -133 },
    "Dial test, 30 deg": { flexion: 30, ie: 5 }, "Dial test, 90 deg": { flexion: 90, ie: 5 },
    "Valgus stress, 30 deg": { flexion: 30, vv: 10 }, "Varus stress, 30 deg": { flexion: 30, vv: -10 },
    "Pivot shift": { flexion: 30, vv: 8, ie: -4 },
  };
  /** @type {[keyof LiveTold["pose"], string, string, string][]} */
  const POSE = [
    ["vv_deg", "valgus", "varus", "deg"], ["ie_deg", "external", "internal", "deg"],
    ["ml_mm", "lateral", "medial", "mm"], ["ap_mm", "anterior", "posterior", "mm"], ["si_mm", "superior", "inferior", "mm"],
  ];
  /** @type {(keyof LiveTold["pose"])[]} */
  const TOLD_FIRST = ["ap_mm", "ie_deg", "vv_deg", "ml_mm", "si_mm"];
  const CONTACT = [["force_n", "force", "N", 0], ["area_mm2", "area", "mm2", 0], ["mean_mpa", "mean pressure", "MPa", 2], ["peak_mpa", "peak pressure", "MPa", 2]];
  /** @type {Record<string, number>} */
  const SPARE = { deg: 5, "N m": 0.5, N: 5, share: 0.1 }; // a trial so far beyond a calibration's is told; the rule of sim/src/reach.rs
  const LEAST_TOLD = 0.05; // a smaller change reads as none [mm, deg]
  const STRAIN = 0.1, STIFFNESS = 4; // how far a reader may change a ligament [-]
  const SAMPLES = [8, 32]; // intervals come early from few samples, then from more
  const QUIET_MS = 350; // so long nothing changes before intervals are sought
  const KEPT = 60; // answers kept for comparison
  const note = section.querySelector(".live-note");
  const element = (name, attributes = {}, ...inner) => {
    const e = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
    e.append(...inner);
    return e;
  };
  const fixed = (x, digits) => (Number.isFinite(x) ? (Math.abs(x) < 0.5 * 10 ** -digits ? 0 : x).toFixed(digits) : "");
  /** @type {<T>(s: T) => T} */
  const clone = (s) => JSON.parse(JSON.stringify(s));
  /** @returns {LiveState} */
  const fresh = () => ({ ...REST, cut: [], strain: {}, stiffness: {}, grafts: [] });
  // where the reader begins and Reset goes: the knee as it was calibrated, or a plan's; `told` gets what could not be taken, in words
  /** @type {(told?: string[]) => LiveState} */
  const begun = (told = []) => {
    if (!section.dataset.start) return fresh();
    const { flexion_deg, load: [vv, ie, ml, ap, si], cut, strain, stiffness, grafts } = JSON.parse(section.dataset.start);
    return { ...fresh(), flexion: flexion_deg, vv, ie, ml, ap, si, cut, strain: strain || {}, stiffness: stiffness || {}, grafts: liveGraft.restored(JSON.stringify(grafts), about, told) };
  };
  // in a frame, as of a notebook, an address is that of the page around it
  const framed = window.self !== window.top;

  // ---- the workers

  const source = (id) => Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
  class Solver {
    constructor() {
      this.waiting = new Map();
      this.worker = new Worker(URL.createObjectURL(new Blob([document.getElementById("live-worker").textContent], { type: "text/javascript" })));
      this.worker.onmessage = ({ data }) => {
        this.ms = data.ms;
        this.waiting.get(data.id)(data.reply);
        this.waiting.delete(data.id);
      };
      this.worker.onerror = (e) => { this.waiting.forEach((done) => done({ fault: e.message || "the worker stopped", broken: true })); this.waiting.clear(); };
      this.opened = this.send({ open: { module: source("live-module"), knee: source("live-knee") } });
    }

    send(message) {
      this.count = (this.count || 0) + 1;
      const id = this.count;
      return new Promise((done) => { this.waiting.set(id, done); this.worker.postMessage({ id, ...message }); });
    }

    // a module that has broken off answers nothing more
    again() {
      this.worker.terminate();
      return new Solver();
    }

    async ask(request) {
      const about = await this.opened;
      return about.fault ? about : this.send({ request });
    }
  }

  // ---- what is asked

  let state = fresh();
  // what is not there yet is asked for by no one: `start` and `shown` come first
  const none = /** @type {any} */ (null);
  /** @type {LiveAbout} */
  let about = none;
  /** @type {Solver} */
  let solver = none;
  let sampler = /** @type {Solver | null} */ (null);
  let view = /** @type {LiveView | null} */ (null);
  const past = /** @type {LiveState[]} */ ([]);
  const back = () => { const last = past.pop(); if (last) change(last, false); };
  /** @type {{ told: LiveReply, rest: LiveReply, intact: LiveReply, bands: LiveBands | null, state: LiveState }} */
  const shown = { told: none, rest: none, intact: none, bands: null, state };
  /** @type {Map<string, LiveReply>} */
  const kept = new Map();
  /** @type {(s: LiveState) => LiveAsked} */
  const asked = (s) => ({ flexion_deg: s.flexion, load: [s.vv, s.ie, s.ml, s.ap, s.si], cut: s.cut, strain: s.strain, stiffness: s.stiffness, grafts: s.grafts });
  /** @type {(s: LiveState) => LiveState} */
  const intactOf = (s) => ({ ...s, cut: [], strain: {}, stiffness: {}, grafts: [] });
  /** The same knee, as it is cut, changed and grafted, under its compression alone: from there the page of a plan counts, too. @type {(s: LiveState) => LiveState} */
  const restOf = (s) => ({ ...s, vv: 0, ie: 0, ml: 0, ap: 0 });
  /** @type {(s: LiveState) => boolean} */
  const isIntact = (s) => !(Object.keys(s.strain).length + Object.keys(s.stiffness).length + s.cut.length + s.grafts.length);
  // every bundle of a state with its place in the answer's lists
  const bundles = (s) => [...about.bundles.map((b) => b.name), ...s.grafts.map((_, k) => `graft${k}`)];

  /** @type {(s: LiveState) => Promise<LiveReply>} */
  async function answer(s) {
    const key = JSON.stringify(asked(s));
    if (!kept.has(key)) {
      const reply = await solver.ask({ trial: asked(s) });
      if (!reply.fault) section.dataset.ms = solver.ms.toFixed(1);
      if (reply.broken) { solver = solver.again(); return reply; }
      if (kept.size >= KEPT) kept.delete([...kept.keys()][0]);
      kept.set(key, reply);
    }
    return /** @type {LiveReply} */ (kept.get(key));
  }

  let running = false, again = false, quiet = 0;
  async function solve() {
    section.dataset.busy = "yes";
    delete section.dataset.samples; // those of the state before
    clearTimeout(quiet);
    again = true;
    if (running) return;
    running = true;
    while (again) {
      again = false;
      const s = clone(state);
      const told = await answer(s);
      const rest = await answer(restOf(s)), intact = isIntact(s) ? told : await answer(intactOf(s));
      Object.assign(shown, { told, rest, intact, bands: null, state: s });
      show();
    }
    running = false;
    delete section.dataset.busy;
    spoken.textContent = words.textContent;
    quiet = setTimeout(intervals, QUIET_MS);
  }

  async function intervals() {
    delete section.dataset.samples;
    if (!about.samples || shown.told.fault || section.dataset.pulling) return;
    sampler = sampler || new Solver();
    const mine = JSON.stringify(state), from = performance.now();
    for (const most of SAMPLES) {
      const bands = await sampler.ask({ bands: { trial: asked(JSON.parse(mine)), most } });
      if (bands.broken) sampler = sampler.again();
      if (mine !== JSON.stringify(state) || section.dataset.busy) return;
      shown.bands = bands.fault ? null : bands;
      said.textContent = bands.fault || liveWords.intervals(bands, about.interval, isOff());
      show();
      section.dataset.bandsMs = (performance.now() - from).toFixed(0);
      section.dataset.samples = bands.fault ? 0 : bands.asked;
    }
  }

  /** @type {(next: LiveState, remembered?: boolean, told?: string[]) => void} */
  function change(next, remembered = true, told = []) {
    if (remembered) past.push(clone(state));
    state = next;
    heard.textContent = told.join(" ");
    controls();
    solve();
  }

  // ---- the answer

  const words = element("p", { class: "live-words" });
  const heard = element("p", { class: "live-heard", role: "status" }); // what was done with a number or a link that could not be taken as it was
  const spoken = element("p", { class: "unseen", role: "status" });
  const said = element("p", { class: "live-said" });
  const towards = (of, [key, more, less, unit]) => (Math.abs(of) < LEAST_TOLD ? null : `${fixed(Math.abs(of), 1)} ${unit} ${of > 0 ? more : less}`);
  const pose = (key) => POSE.filter((p) => p[0] === key)[0];
  /** @type {(a: LiveReply, b: LiveReply) => string} */
  const moves = (a, b) => TOLD_FIRST.map((key) => towards(a.pose[key] - b.pose[key], pose(key))).filter(Boolean).slice(0, 3).join(", ");
  const isOff = () => Boolean(shown.told && !shown.told.fault && shown.told.flags.includes("dislocated"));
  const brief = (s) => s.words.split(" (")[0].toLowerCase(), column = ({ key, unit }) => (key === "flexion" ? "flexion_deg" : `${key}_${unit === "N" ? "n" : "nm"}`);
  // what is asked beyond the calibration's trials, by the rule of sim/src/reach.rs
  /** @type {(s: LiveState) => string[]} */
  const beyond = (s) => SLIDERS.flatMap((slide) => {
    if (!about.reach) return [];
    const { key, unit } = slide, [low, high] = about.reach[column(slide)], digits = unit === "N m" ? 1 : 0;
    const spare = (end) => (unit === "deg" ? SPARE.deg : Math.max(SPARE.share * Math.abs(end), SPARE[unit]));
    const far = s[key] < low - spare(low) || s[key] > high + spare(high);
    return far ? [`${brief(slide)} of ${s[key]} ${unit} (measured ${fixed(low, digits)} to ${fixed(high, digits)} ${unit})`] : [];
  });
  // a ligament whose bundles are all cut by its own name
  const cutWords = (cut) => [...groups()].flatMap(([name, own]) => (own.every((n) => cut.includes(n)) ? [name] : own.filter((n) => cut.includes(n)))).join(", ");

  function sentence() {
    const { told, rest, intact, state: s } = shown, far = beyond(s);
    if (told.fault) return `No answer: ${/no equilibrium/.test(told.fault) ? "no pose was found in which all forces cancel" : told.fault}. Undo, or choose smaller loads.`;
    const gone = rest.fault ? "" : moves(told, rest), off = (a) => (a.flags.includes("dislocated") ? " (whose femur has left the plateau)" : "");
    let text = `At ${fixed(told.pose.fe_deg, 0)} deg the tibia ${rest.fault ? "has no pose at rest to compare with" : gone ? `goes ${gone} from rest` : "lies as it does at rest"}.`;
    if (!isIntact(s) && !intact.fault) text += ` Against the knee as it was calibrated${off(intact)}, under the same loads: ${moves(told, intact) || "no difference"}.`;
    if (s.cut.length) text += ` Cut: ${cutWords(s.cut)}.`;
    s.grafts.forEach((g, k) => { text += ` ${g.name[0].toUpperCase()}${g.name.slice(1)} bears ${fixed(told.forces_n[about.bundles.length + k], 0)} N.`; });
    if (far.length) text += ` This goes beyond what was measured on this knee: ${far.join(", ")}. The numbers here are extrapolated.`;
    return [text, ...told.flags.map(liveWords.flag)].join(" ");
  }

  function show() {
    const { told, state: s } = shown;
    words.textContent = sentence();
    words.classList.toggle("odd", Boolean(told.fault || told.flags.length || beyond(s).length));
    // numbers that are none of this state, or of no knee, are grey and say so
    section.classList.toggle("off", Boolean(told.fault) || isOff());
    section.querySelectorAll(".live-off").forEach((e) => { e.textContent = told.fault ? " (grey: of the state before)" : isOff() ? " (grey: the femur has left the plateau)" : ""; });
    if (told.fault) return;
    poses();
    ligaments();
    contacts();
    picture();
  }

  /** @type {(name: string) => LiveBand | false | null} */
  const band = (name) => !isOff() && shown.bands && shown.bands.bands[name];
  const interval = (name, digits) => { const b = band(name); return b ? `${fixed(b.lower, digits)} to ${fixed(b.upper, digits)}` : isOff() && about.samples ? "not told" : ""; };
  const cells = (row, texts) => texts.forEach((text, n) => { row.cells[n + 1].textContent = text; });
  // a head in brackets is for a screen reader alone
  const table = (id, caption, heads, rows) => {
    const body = element("tbody", {}, ...rows.map((r) => element("tr", { "data-row": r.key }, element("th", { scope: "row" }, r.words), ...heads.slice(1).map(() => element("td")))));
    const head = element("thead", {}, element("tr", {}, ...heads.map((h) => element("th", { scope: "col" }, h.startsWith("(") ? element("span", { class: "unseen" }, h.slice(1, -1)) : h))));
    return element("div", { class: "wide" }, element("table", { id }, element("caption", {}, caption, element("span", { class: "live-off" })), head, body));
  };

  const poseTable = table("live-pose", "Pose of the tibia under the femur. Rest is this knee, with what was cut or put in, under the compression alone.", ["(direction)", "pose", "90 % interval", "from rest", "against the calibrated knee"], POSE.map(([key, more, less, unit]) => ({ key, words: `${more}, ${unit} (${less} below 0)` })));
  function poses() {
    const { told, rest, intact } = shown;
    poseTable.querySelectorAll("tbody tr").forEach((row) => {
      const key = row.dataset.row;
      const less = (from) => (from.fault ? "" : fixed(told.pose[key] - from.pose[key], 2));
      cells(row, [fixed(told.pose[key], 2), interval(key, 2), less(rest), less(intact)]);
    });
  }

  let ligamentTable = null, contactTable = null, mostForce = 50;
  const forceBar = () => element("div", { class: "bar", "aria-hidden": "true" }, element("div", { class: "fill" }), element("div", { class: "range", hidden: "" }));
  // a row for each graft below the knee's own bundles
  function graftRows(s) {
    const body = ligamentTable.querySelector("tbody");
    [...body.querySelectorAll("[data-graft]")].slice(s.grafts.length).forEach((row) => row.remove());
    s.grafts.forEach((g, k) => {
      let row = body.querySelector(`[data-graft="${k}"]`);
      if (!row) {
        row = element("tr", { "data-row": `graft${k}`, "data-graft": k }, element("th", { scope: "row" }), ...Array.from({ length: 7 }, () => element("td")));
        row.cells[2].append(forceBar());
        row.cells[6].append(button("Take out", () => grafts.taken(k)));
        body.append(row);
      }
      row.cells[0].textContent = g.name;
      row.querySelector("button").setAttribute("aria-label", `Take out ${g.name}`);
    });
  }

  function ligaments() {
    const { told, intact, state: s } = shown;
    graftRows(s);
    const all = bundles(s);
    if (!isOff()) mostForce = Math.max(mostForce, ...told.forces_n, ...(shown.bands ? all.map((b) => (band(`force_${b}_n`) || { upper: 0 }).upper) : []));
    all.forEach((name, n) => {
      const row = ligamentTable.querySelector(`[data-row="${name}"]`), isCut = s.cut.includes(name), before = intact.fault ? NaN : intact.forces_n[n];
      cells(row, [fixed(told.forces_n[n], 1)]);
      row.cells[3].textContent = isCut ? "" : interval(`force_${name}_n`, 1);
      row.cells[4].textContent = told.strains[n] === null ? "cut" : fixed(100 * told.strains[n], 1);
      row.cells[5].textContent = fixed(before, 1);
      const share = (x) => `${(100 * Math.min(1, x / mostForce)).toFixed(1)}%`, b = isCut ? null : band(`force_${name}_n`);
      row.querySelector(".fill").style.width = share(told.forces_n[n]);
      const range = row.querySelector(".range");
      range.hidden = !b;
      if (b) { range.style.left = share(b.lower); range.style.width = share(b.upper - b.lower); }
    });
    grafts.paint(s, told.grafts);
  }

  const output = (told, name) => (told.outputs.find((o) => o[0] === name) || [name, NaN])[1];
  function contacts() {
    contactTable.querySelectorAll("tbody tr").forEach((row) => {
      const name = row.dataset.row, digits = Number(name.endsWith("mpa")) * 2;
      cells(row, [fixed(output(shown.told, name), digits), interval(name, digits), shown.intact.fault ? "" : fixed(output(shown.intact, name), digits)]);
    });
  }

  function picture() {
    if (!view || view.closed) return;
    const { told, state: s } = shown;
    const cut = new Set(about.fibres.flatMap((b, f) => (s.cut.includes(about.bundles[b].name) ? [f] : [])));
    view.place({ femur: told.femur, force: told.fibres_n, pressed: told.pressure, grafts: liveGraft.lines(s.grafts, about), cut, label: "" });
  }

  // ---- the pointer on the picture

  const side = () => (about.side === "left" ? -1 : 1); // the page's x is the patient's right
  let pulledFrom = null, grafts = null;
  const way = element("select", { id: "live-way" }, element("option", { value: "pull" }, "pulls at it"), element("option", { value: "turn" }, "turns it"), element("option", { value: "" }, "turns the picture"));
  const springs = element("input", { type: "checkbox", id: "live-springs" });
  // by a step of its slider and within it, or no further beyond it than it was
  const stepped = (key, from, by) => {
    const { least, most, step } = SLIDERS.filter((s) => s.key === key)[0], x = Math.round((from + by) / step) * step;
    return Number(Math.min(Math.max(most, from), Math.max(Math.min(least, from), x)).toFixed(3));
  };
  const signed = (x, unit) => `${x > 0 ? "+" : ""}${fixed(x, unit === "N" ? 0 : 1)} ${unit}`;

  // meanwhile no intervals are sought, and fewer pixels drawn
  const heldOn = () => { section.dataset.pulling = "yes"; if (view && !view.closed) liveDraft.begin(view); };
  const letGo = () => { delete section.dataset.pulling; if (view && !view.closed) liveDraft.end(view); };

  /** The loads of a pull, added to those before it and held within the sliders. @type {(pull: LivePull, turns: boolean) => { force: Triple, words: string }} */
  function pulled({ force: [x, y, z], moment: [, about_y, about_z] }, turns) {
    const b = pulledFrom;
    const added = turns ? { vv: -side() * about_y, ie: -side() * about_z } : { ap: y, ml: side() * x, si: z };
    const next = { ...clone(state), ...Object.fromEntries(SLIDERS.map(({ key }) => [key, b[key]])) };
    for (const [key, by] of Object.entries(added)) next[key] = stepped(key, b[key], by);
    change(next, false);
    if (turns) return { force: [x, y, z], words: `valgus ${signed(next.vv, "N m")}, external ${signed(next.ie, "N m")}` };
    const borne = /** @type {Triple} */ ([side() * (next.ml - b.ml), next.ap - b.ap, next.si - b.si]);
    return { force: borne, words: `${fixed(Math.hypot(...borne), 0)} N: forwards ${signed(next.ap, "N")}, outwards ${signed(next.ml, "N")}, up ${signed(next.si, "N")}` };
  }

  function hand() {
    if (view) liveHand.attach(view, {
      way: () => (about && !about.fault && shown.told ? way.value : ""),
      placing: () => grafts.placing(),
      began: () => { pulledFrom = clone(state); past.push(clone(state)); heldOn(); },
      pulled,
      ended: (kept) => {
        letGo();
        // Escape, or let go of a spring: as before, and nothing to undo
        if (!kept || springs.checked) back(); else solve();
      },
      clicked: ({ bone, fibre }) => {
        if (!shown.told || shown.told.fault || grafts.clicked(bone) || fibre < 0) return;
        const b = about.fibres[fibre];
        if (b !== undefined) toggled(groups().get(about.bundles[b].name.split("_")[0]));
        else grafts.taken(graftOf(fibre - about.fibres.length));
      },
    });
  }
  // the ends of the knee's own fibres in CT, in the page's axes
  const fibreLines = () => {
    const [pool, id] = section.querySelector("figure").dataset.scene.split("/");
    return JSON.parse(document.getElementById("data").textContent)[pool].scenes.find((x) => x.id === id).layers.find((l) => l.moves === "fibres").lines;
  };
  // the graft that a fibre behind the knee's own belongs to
  const graftOf = (n) => { let k = 0; for (const g of state.grafts) { n -= g.ends.length; if (n < 0) return k; k++; } return k; };

  // ---- controls

  const inputs = {};
  const button = (text, act, attributes = {}) => {
    const b = element("button", { type: "button", ...attributes }, text);
    b.addEventListener("click", act);
    return b;
  };

  // a number within what is taken; what was done to it is told
  const within = (name, x, [least, most], unit, told) => {
    const out = Math.min(most, Math.max(least, x));
    if (out !== x) told.push(`${name[0].toUpperCase()}${name.slice(1)}: ${x} ${unit} is beyond what can be asked (${least} to ${most} ${unit}), so it is ${out} ${unit}.`);
    return out;
  };
  const taken = (slide, x, told) => within(brief(slide), x, slide.taken || about.flexion_deg, slide.unit, told);

  function slider(slide) {
    const { key, words: text, unit, least, most, step } = slide, range = element("input", { type: "range", id: `live-${key}`, min: least, max: most, step });
    const number = element("input", { type: "text", inputmode: "decimal", size: 6, "aria-label": `${text}, ${unit}` });
    let held = false;
    range.addEventListener("input", () => { heldOn(); change({ ...clone(state), [key]: Number(range.value) }, !held); held = true; });
    range.addEventListener("change", () => { held = false; letGo(); solve(); });
    // a comma is a decimal point, too
    number.addEventListener("change", () => {
      const given = number.value.trim(), value = Number(given.replace(",", ".")), told = [];
      if (given && Number.isFinite(value)) { change({ ...clone(state), [key]: taken(slide, value, told) }, true, told); return; }
      controls();
      heard.textContent = `${given ? `"${given}"` : "Nothing"} is no number: ${brief(slide)} stays ${state[key]} ${unit}.`;
    });
    inputs[key] = { range, number, unit };
    return element("div", { class: "live-slider" }, element("label", { for: `live-${key}` }, text), range, number, ` ${unit}`);
  }

  // the bundles of a ligament: those that share what stands before the underscore
  const groups = () => {
    const out = new Map();
    about.bundles.forEach(({ name }) => { const g = name.split("_")[0]; out.set(g, [...(out.get(g) || []), name]); });
    return out;
  };
  const toggled = (names) => {
    const all = names.every((n) => state.cut.includes(n));
    const cut = state.cut.filter((n) => !names.includes(n));
    change({ ...clone(state), cut: about.bundles.map((b) => b.name).filter((n) => cut.includes(n) || (!all && names.includes(n))) });
  };

  function tuning(name) {
    const one = (what, words_, least, most, step, none, unit) => {
      const range = element("input", { type: "range", min: least, max: most, step, "aria-label": `${words_} of ${name}` });
      const told = element("output");
      let held = false;
      range.addEventListener("input", () => {
        const next = clone(state), value = what === "stiffness" ? 2 ** Number(range.value) : Number(range.value);
        if (Math.abs(value - none) < 1e-9) delete next[what][name]; else next[what][name] = value;
        change(next, !held);
        held = true;
      });
      range.addEventListener("change", () => { held = false; });
      inputs[`${what} ${name}`] = { paint: () => {
        const value = state[what][name] ?? none;
        range.value = what === "stiffness" ? Math.log2(value) : value;
        told.textContent = unit(value);
        range.setAttribute("aria-valuetext", told.textContent);
      } };
      return element("label", { class: "live-tune" }, `${words_} `, range, told);
    };
    const [low, high] = [-Math.log2(STIFFNESS), Math.log2(STIFFNESS)];
    return element("details", {}, element("summary", { "aria-label": `Change ${name}` }, "Change"),
      one("strain", "strain in CT", -STRAIN, STRAIN, 0.005, 0, (v) => `${v >= 0 ? "+" : ""}${fixed(100 * v, 1)} %`),
      one("stiffness", "stiffness", low, high, 0.1, 1, (v) => `x ${fixed(v, 2)}`));
  }

  function build() {
    const presets = element("div", { role: "group", "aria-label": "Tests", class: "live-presets" });
    for (const [name, loads] of Object.entries(PRESETS)) presets.append(button(name, () => change({ ...clone(state), ...REST, si: begun().si, ...loads }), { "data-preset": name }));
    const cuts = element("div", { role: "group", "aria-label": "Cut a ligament", class: "live-cuts" }, "Cut: ");
    for (const [name, names] of groups()) {
      const b = button(name, () => toggled(names), { "data-cut": name, "aria-pressed": "false", title: liveWords.NAMES[name] || name });
      inputs[`cut ${name}`] = { paint: () => b.setAttribute("aria-pressed", String(names.every((n) => state.cut.includes(n)))) };
      cuts.append(b);
    }
    const acts = element("div", { role: "group", "aria-label": "State", class: "live-acts" },
      button("Undo", back, { "data-act": "undo" }), button("Reset", () => { if (view) view.most = null; grafts.stop(); go(begun); }, { "data-act": "reset" }),
      button("Save CSV", csv, { "data-act": "csv" }), framed ? button("Copy this state", copied, { id: "live-link" }) : element("a", { href: "#live", id: "live-link" }, "Link to this state"));
    const pointer = element("p", { class: "live-pointer" }, element("label", { for: "live-way" }, "A drag on the tibia "), way, " ", element("label", {}, springs, " and springs back"),
      element("span", {}, "With Shift a pull is a turn and a turn a pull. Escape takes it back. A click on a ligament cuts it."));
    grafts = liveGraft.controls({ about, element, button, fixed, get: () => clone(state), change, compression: () => begun().si, femur: () => shown.told.femur, lines: () => fibreLines() });
    section.querySelector(".live-controls").append(presets, ...SLIDERS.map(slider), pointer, cuts, grafts.html, acts, heard, words, spoken);
    const rows = about.bundles.map(({ name }) => ({ key: name, words: name }));
    ligamentTable = table("live-ligaments", "Ligaments", ["(ligament)", "force, N", "(force as a bar)", "90 % interval, N", "strain, %", "as calibrated, N", "(cut or restore)", "(change)"], rows);
    ligamentTable.querySelectorAll("tbody tr").forEach((row) => {
      const name = row.dataset.row;
      row.cells[2].append(forceBar());
      const b = button("Cut", () => toggled([name]));
      inputs[`bundle ${name}`] = { paint: () => {
        const is = state.cut.includes(name);
        b.textContent = is ? "Restore" : "Cut";
        b.setAttribute("aria-label", `${b.textContent} ${name}`);
        row.classList.toggle("cut", is);
      } };
      row.cells[6].append(b);
      row.cells[7].append(tuning(name));
    });
    const contact = ["medial", "lateral"].flatMap((side) => CONTACT.map(([what, text, unit]) => ({ key: `contact_${side}_${what}`, words: `${side} ${text}, ${unit}` })));
    contactTable = table("live-contact", "Contact of the cartilages", ["(of what)", "value", "90 % interval", "as calibrated"], contact);
    const known = element("p", { class: "live-names" }, `${[...groups().keys()].filter((g) => liveWords.NAMES[g]).map((g) => `${g}: ${liveWords.NAMES[g]}`).join("; ")}.`);
    section.querySelector(".live-answer").append(said, ligamentTable, known, element("div", { class: "live-two" }, poseTable, contactTable));
  }

  function controls() {
    for (const { key } of SLIDERS) {
      const { range, number, unit } = inputs[key];
      range.value = state[key];
      range.setAttribute("aria-valuetext", `${state[key]} ${unit}`);
      number.value = String(state[key]);
    }
    Object.values(inputs).forEach((i) => i.paint && i.paint());
    section.dataset.state = fragment(state);
    if (!framed) document.getElementById("live-link").setAttribute("href", fragment(state));
    const none = section.closest("[data-unasked]") ? "No samples were asked for" : about.reach ? "This calibration left no samples" : "This model has no samples of a calibration";
    said.textContent = about.samples ? "" : `${none}, so there are no intervals.`;
  }

  // ---- link and file

  const pairs = (map) => Object.entries(map).map(([k, v]) => `${k}:${v}`).join(",");
  /** @type {(s: LiveState) => string} */
  const fragment = (s) => {
    const parts = SLIDERS.filter(({ key }) => s[key] !== REST[key] || key === "flexion").map(({ key }) => [key, String(s[key])]);
    const more = [["cut", s.cut.join(",")], ["strain", pairs(s.strain)], ["stiffness", pairs(s.stiffness)], ["graft", s.grafts.length ? JSON.stringify(s.grafts) : ""]].filter(([, v]) => v);
    return "#live&" + new URLSearchParams([...parts, ...more]);
  };
  // what does not fit this knee is left out; `told` gets it in words. Without a state: where the reader begins
  /** @type {(hash: string, told: string[]) => LiveState} */
  const restored = (hash, told) => {
    if (hash === "#live&") return begun(told);
    const given = new URLSearchParams(hash.replace(/^#live&/, "")), out = fresh(), odd = [];
    const is = (name) => about.bundles.some((b) => b.name === name), parts = (key) => (given.get(key) || "").split(",").filter(Boolean), number = (text) => (text && text.trim() ? Number(text) : NaN);
    for (const slide of SLIDERS.filter(({ key }) => given.has(key))) {
      const { key } = slide, value = number(given.get(key));
      if (Number.isFinite(value)) out[key] = taken(slide, value, told); else odd.push(`${key}=${given.get(key)}`);
    }
    const cut = parts("cut").flatMap((n) => (is(n) ? [n] : groups().get(n) || (odd.push(n), [])));
    out.cut = about.bundles.map((b) => b.name).filter((n) => cut.includes(n));
    for (const [what, least, most] of /** @type {["strain" | "stiffness", number, number][]} */ ([["strain", -STRAIN, STRAIN], ["stiffness", 1 / STIFFNESS, STIFFNESS]])) {
      for (const part of parts(what)) {
        const [name, text] = part.split(":"), value = number(text);
        if (is(name) && Number.isFinite(value)) out[what][name] = within(`${what} of ${name}`, value, [least, most], what === "strain" ? "of its length" : "times its own", told); else odd.push(part);
      }
    }
    out.grafts = liveGraft.restored(given.get("graft") || "[]", about, told);
    if (odd.length) told.push(`Left out of the link, as this knee has no such thing: ${odd.join(", ")}.`);
    return out;
  };
  // goes to what `from` gives, with what it tells
  const go = (from) => { const told = []; change(from(told), true, told); };
  async function copied() {
    const text = fragment(state), how = "behind the address of the report to open it in this state";
    try { await navigator.clipboard.writeText(text); heard.textContent = `Copied. Put it ${how}: ${text}`; } catch { heard.textContent = `Copy this and put it ${how}: ${text}`; }
  }

  function csv() {
    const { told, rest, intact, bands, state: s } = shown, quoted = (x) => (/[",\n]/.test(x) ? `"${x.replaceAll('"', '""')}"` : x);
    /** @type {(row: any[]) => string} */
    const one = ([name, value]) => [name, quoted(String(value)), "", "", "", "", ""].join(",");
    const line = (name, of) => {
      const b = bands && bands.bands[name];
      return [name, ...[of(told), b && b.mean, b && b.lower, b && b.upper, of(intact), of(rest)].map((x) => (Number.isFinite(x) ? String(x) : ""))].join(",");
    };
    const asks = SLIDERS.map((slide) => [`${slide.key === "flexion" ? "asked" : "load"}_${column(slide)}`, s[slide.key]]);
    const changed = Object.entries({ added_strain: s.strain, stiffness_factor: s.stiffness }).flatMap(([what, of]) => Object.entries(of).map(([name, x]) => [`${what}_${name}`, x]));
    const done = [["cut", s.cut.join(" ")], ...changed, ...s.grafts.flatMap((g, k) => liveGraft.rows(g, k, told.grafts && told.grafts[k])),
      ["flags", told.fault || told.flags.join("; ")], ["beyond_calibration", beyond(s).join("; ")], ["samples_of_calibration", about.samples],
      ...["asked", "lost", "leaving"].map((key) => [`samples_${key}`, bands ? bands[key] : 0])];
    const answered = told.fault ? [] : [...Object.keys(told.pose).map((key) => line(key, (t) => t.pose && t.pose[key])),
      ...bundles(s).map((b, n) => line(`force_${b}_n`, (t) => t.forces_n && t.forces_n[n])),
      ...bundles(s).map((b, n) => line(`strain_${b}`, (t) => t.strains && (t.strains[n] ?? NaN))),
      ...told.outputs.map(([name]) => line(name, (t) => t.outputs && output(t, name)))];
    const text = ["name,value,mean,lower,upper,as_calibrated,at_rest", ...asks.map(one), ...done.map(one), ...answered, ""].join("\n");
    const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: `${about.id}-live.csv` });
    section.dataset.csv = text;
    link.click();
  }

  // ---- the start

  async function start() {
    if (solver) return;
    note.textContent = "The knee is being opened.";
    const from = performance.now();
    try {
      solver = new Solver();
      about = await solver.opened;
    } catch (error) { about = { ...about, fault: String(error) }; }
    if (about.fault) {
      const stored = document.getElementById("scene-a-knee") ? " The motions that were stored with the report show it: see the knee in 3D above." : "";
      note.textContent = `The knee cannot be opened here (${about.fault}).${stored}`;
      return;
    }
    section.dataset.opened = (performance.now() - from).toFixed(0);
    note.remove();
    build();
    const told = [];
    state = location.hash.startsWith("#live&") ? restored(location.hash, told) : begun(told);
    heard.textContent = told.join(" ");
    controls();
    if (view) hand();
    await solve();
    section.dataset.ready = "yes";
  }

  const figure = section.querySelector("figure");
  figure.addEventListener("shown", (e) => { view = e.detail; if (grafts) hand(); if (shown.told && !shown.told.fault) picture(); });
  const needed = { WebAssembly: typeof WebAssembly === "object", Worker: typeof Worker === "function", DecompressionStream: typeof DecompressionStream === "function" };
  const missing = Object.keys(needed).filter((name) => !needed[name]);
  if (missing.length) {
    note.firstElementChild.textContent = `This browser has no ${missing.join(" and no ")}, so nothing can be pulled at.`;
    if (missing.length === 1) note.childNodes[1].data = note.childNodes[1].data.replace("Without them", "Without it");
    return;
  }
  window.addEventListener("hashchange", () => {
    if (!about || about.fault || !location.hash.startsWith("#live&")) return;
    go((told) => restored(location.hash, told));
    section.scrollIntoView();
  });
  // a link within the page would take a frame to the page around it
  if (framed) document.addEventListener("click", (e) => {
    const link = e.target instanceof Element && e.target.closest("a[href^='#']"), to = link && document.getElementById((link.getAttribute("href") || "").slice(1));
    if (to) { e.preventDefault(); to.scrollIntoView(); }
  });
  new IntersectionObserver((entries) => { if (entries.some((e) => e.isIntersecting)) start(); }, { rootMargin: "200px" }).observe(section);
  if (location.hash.startsWith("#live&")) { section.scrollIntoView(); start(); }
})();
