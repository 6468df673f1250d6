// Grafts of the live knee: put in by two clicks on the bones, or between the footprints of a ligament; listed, and as a plan has them.
"use strict";
const liveGraft = (() => {
  const MOST = 12; // grafts that a reader adds at most, as each takes time to fix; a plan or a link may have more. Ours
  const COMPRESSION_N = 20; // what the knee bears while a graft is fixed, unless it is told (sim/src/graft.rs)
  const DIGITS = 100; // ends are kept to a hundredth of a millimetre
  /** @type {(p: Triple) => Triple} */
  const rounded = ([x, y, z]) => [Math.round(x * DIGITS) / DIGITS, Math.round(y * DIGITS) / DIGITS, Math.round(z * DIGITS) / DIGITS];
  /** @type {(m: number[], p: Triple) => Triple} */
  const moved = (m, p) => {
    const row = (/** @type {number} */ r) => m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3];
    return [row(0), row(1), row(2)];
  };
  /** The way back of a rigid motion. @type {(m: number[]) => (p: Triple) => Triple} */
  const back = (m) => {
    return (p) => {
      const d = [p[0] - m[3], p[1] - m[7], p[2] - m[11]], row = (/** @type {number} */ c) => m[c] * d[0] + m[4 + c] * d[1] + m[8 + c] * d[2];
      return [row(0), row(1), row(2)];
    };
  };
  /** @type {(x: number, range: [number, number]) => number} */
  const inside = (x, [least, most]) => Math.min(most, Math.max(least, x));

  /** What a link or a plan says of grafts, as far as it makes sense; `told` gets what is left out or held within a range, in words.
   * @type {(text: string, about: LiveAbout, told: string[]) => LiveGraft[]} */
  function restored(text, about, told) {
    let given = null;
    try { given = JSON.parse(text); } catch { /* said below */ }
    if (!Array.isArray(given)) { told.push("The grafts cannot be read, so none is in."); return []; }
    /** @type {(p: any) => boolean} */
    const point = (p) => Array.isArray(p) && p.length === 3 && p.every(Number.isFinite);
    /** @type {(g: any) => boolean} */
    const sound = (g) => g && typeof g === "object" && Array.isArray(g.ends) && g.ends.length && g.ends.every((/** @type {any} */ e) => Array.isArray(e) && e.length === 2 && e.every(point)) && Number.isFinite(g.stiffness_n_per_mm)
      && g.drawn && (Number.isFinite(g.drawn.tension_n) ? Number.isFinite(g.drawn.at_flexion_deg) : Number.isFinite(g.drawn.slack_length_mm));
    /** @type {(given: LiveGraft) => LiveGraft} */
    const kept = ({ name, ends, stiffness_n_per_mm, toe_strain, like, drawn }) => {
      /** @type {(what: string, x: number, range: [number, number], unit: string) => number} */
      const held = (what, x, range, unit) => {
        const out = inside(x, range);
        if (out !== x) told.push(`${name}: a ${what} of ${x} ${unit} is beyond ${range.join(" to ")} ${unit}, so it is ${out} ${unit}.`);
        return out;
      };
      /** @type {LiveGraft} */
      const out = { name: String(name), ends, stiffness_n_per_mm: held("stiffness", stiffness_n_per_mm, about.graft.stiffnesses_n_per_mm, "N/mm"), drawn: { ...drawn } };
      if (toe_strain !== undefined && Number.isFinite(toe_strain)) out.toe_strain = toe_strain;
      if (about.bundles.some((b) => b.name === like)) out.like = like;
      if ("tension_n" in drawn) out.drawn = { ...drawn, tension_n: held("tension", drawn.tension_n, about.graft.tensions_n, "N") };
      return out;
    };
    const good = given.filter(sound);
    if (good.length < given.length) told.push(`Of ${given.length} grafts ${given.length - good.length} cannot be read and ${given.length - good.length === 1 ? "is" : "are"} left out.`);
    return good.map(kept);
  }

  /** A place in CT, in the middle of the fibres of a bundle. @type {(points: Triple[]) => Triple} */
  const middle = (points) => {
    const mean = (/** @type {number} */ k) => points.reduce((sum, p) => sum + p[k], 0) / points.length;
    return [mean(0), mean(1), mean(2)];
  };

  /** The compression is what a graft is fixed under [N]; the femur its motion; lines are those of the fibres, in the page's axes.
   * @param {{ about: LiveAbout, element: (name: string, attributes?: Record<string, string | number>, ...inner: (Node | string)[]) => any, button: (text: string, act: () => void, attributes?: Record<string, string | number>) => HTMLElement,
   *   fixed: (x: number, digits: number) => string, compression: () => number, get: () => LiveState, change: (next: LiveState) => void, femur: () => number[], lines: () => Triple[] }} of */
  function controls(of) {
    const { about, element, button, fixed } = of;
    const told = element("p", { class: "live-graft-said", role: "status" });
    /** @type {(words: string, unit: string, value: number, range: [number, number], id: string) => { read: () => number, html: HTMLElement }} */
    const number = (words, unit, value, range, id) => {
      const input = element("input", { type: "text", inputmode: "decimal", size: 6, id, value: String(value) });
      const read = () => {
        const x = Number(input.value.trim().replace(",", "."));
        const good = Number.isFinite(x) && input.value.trim() ? inside(x, range) : value;
        input.value = String(good);
        return good;
      };
      input.addEventListener("change", read);
      return { read, html: element("label", {}, `${words}, ${unit} `, input) };
    };
    const stiffness = number("stiffness", "N/mm", about.graft.stiffness_n_per_mm, about.graft.stiffnesses_n_per_mm, "live-graft-stiffness");
    const tension = number("tension when fixed", "N", about.graft.tension_n, about.graft.tensions_n, "live-graft-tension");
    let first = /** @type {Triple | null} */ (null), placing = false;
    /** @type {(text: string) => void} */
    const say = (text) => { told.textContent = text; };
    const stop = (text = "") => { placing = false; first = null; begin.setAttribute("aria-pressed", "false"); begin.textContent = "Add a graft"; say(text); };
    const begin = button("Add a graft", () => {
      if (placing) { stop(); return; }
      if (of.get().grafts.length >= MOST) { say(`There are ${MOST} grafts; take one out first.`); return; }
      placing = true;
      begin.setAttribute("aria-pressed", "true");
      begin.textContent = "Stop placing";
      say("Click the femur where the graft leaves it.");
    }, { "data-act": "graft", "aria-pressed": "false" });
    /** @type {(ends: [Triple, Triple]) => void} */
    const put = (ends) => {
      const state = of.get(), names = state.grafts.map((g) => g.name);
      let n = 1;
      while (names.includes(`graft ${n}`)) n++;
      /** @type {{ tension_n: number, at_flexion_deg: number, compression_n?: number }} */
      const drawn = { tension_n: tension.read(), at_flexion_deg: state.flexion };
      /** @type {LiveGraft} */
      const graft = { name: `graft ${n}`, ends: [/** @type {[Triple, Triple]} */ (ends.map(rounded))], stiffness_n_per_mm: stiffness.read(), drawn };
      if (of.compression() !== COMPRESSION_N) drawn.compression_n = of.compression();
      of.change({ ...state, grafts: [...state.grafts, graft] });
      stop(`The graft is in: ${drawn.tension_n} N at ${drawn.at_flexion_deg} deg of flexion.`);
    };
    /** @type {(n: number) => void} */
    const taken = (n) => { const state = of.get(); of.change({ ...state, grafts: state.grafts.filter((_, k) => k !== n) }); say("The graft is out."); };
    // without a pointer
    const where = element("select", { id: "live-graft-where" }, ...about.bundles.map((b) => element("option", { value: b.name }, b.name)));
    const there = button("Add it there", () => {
      const b = about.bundles.findIndex((x) => x.name === where.value), lines = of.lines();
      const own = about.fibres.flatMap((bundle, f) => (bundle === b ? [[lines[2 * f], lines[2 * f + 1]]] : []));
      if (of.get().grafts.length >= MOST) { say(`There are ${MOST} grafts; take one out first.`); return; }
      const end = (/** @type {number} */ k) => moved(about.ct, middle(own.map((l) => l[k])));
      put([end(0), end(1)]);
    }, { "data-act": "graft-there" });
    const list = element("ul", { class: "live-grafts" });
    const plan = element("pre", {}), asPlan = element("details", { hidden: "" }, element("summary", {}, "The same for build-model plan"), plan);
    const html = element("fieldset", { class: "live-graft" }, element("legend", {}, "Graft"), begin, stiffness.html, tension.html,
      element("label", { for: "live-graft-where" }, "or between the footprints of "), where, there, told, list, asPlan);

    /** @type {(state: LiveState, grafts: LiveTold["grafts"] | undefined) => void} */
    function paint(state, grafts) {
      list.replaceChildren(...state.grafts.map((g, n) => {
        const t = grafts && grafts[n], how = "tension_n" in g.drawn ? `${Number(g.drawn.tension_n.toFixed(1))} N at ${Number(g.drawn.at_flexion_deg.toFixed(1))} deg` : "by its slack length";
        const long = t ? `; ${fixed(t.length_mm, 1)} mm in CT, slack length ${fixed(t.slack_length_mm, 1)} mm` : "";
        return element("li", {}, `${g.name}: ${fixed(g.stiffness_n_per_mm, 0)} N/mm, fixed with ${how}${long} `, button("Take out", () => taken(n), { "data-take": n, "aria-label": `Take out ${g.name}` }));
      }));
      asPlan.hidden = !state.grafts.length;
      plan.textContent = toml(state);
    }

    /** A click on the knee while a graft is placed; true where that was what it meant. @type {(bone: { name: string, point: Triple } | null) => boolean} */
    function clicked(bone) {
      if (!placing) return false;
      const wanted = first ? "tibia" : "femur";
      if (!bone || bone.name !== wanted) { say(`That is not the ${wanted}. Click the ${wanted}${first ? " where the graft is fixed" : " where the graft leaves it"}.`); return true; }
      if (!first) {
        first = moved(about.ct, back(of.femur())(bone.point));
        say("Now click the tibia.");
      } else put([first, moved(about.ct, bone.point)]);
      return true;
    }
    return { html, paint, clicked, taken, placing: () => placing, stop };
  }

  /** graft.toml of a state. @type {(state: LiveState) => string} */
  function toml(state) {
    const text = (/** @type {string} */ s) => JSON.stringify(s), list = (/** @type {string[]} */ xs) => `[${xs.join(", ")}]`;
    /** @type {(g: LiveGraft) => string} */
    const one = (g) => {
      const end = (/** @type {number} */ k) => `{ point_mm = ${list(middle(g.ends.map((e) => e[k])).map((x) => x.toFixed(2)))} }`;
      const drawn = "tension_n" in g.drawn ? `tension_n = ${g.drawn.tension_n}\nat_flexion_deg = ${g.drawn.at_flexion_deg}` : `slack_length_mm = ${g.drawn.slack_length_mm}`;
      return `\n[[graft]]\nname = ${text(g.name)}\nfemur = ${end(0)}\ntibia = ${end(1)}\nstiffness_n_per_mm = ${g.stiffness_n_per_mm}\n${drawn}\n`;
    };
    // a plan has one compression for all
    const borne = state.grafts.map(({ drawn }) => ("tension_n" in drawn ? drawn.compression_n : undefined)).find((n) => Number.isFinite(n) && n !== COMPRESSION_N);
    return `cut = ${list(state.cut.map(text))}\n${state.grafts.map(one).join("")}${borne === undefined ? "" : `\n[tests]\ncompression_n = ${borne}\n`}`;
  }

  /** What a table has of a graft: names of rows and values; `fixed` is how the knee has it. @type {(g: LiveGraft, k: number, fixed?: LiveTold["grafts"][0]) => (string | number)[][]} */
  function rows(g, k, fixed) {
    const ends = ["femur", "tibia"].flatMap((bone, end) => middle(g.ends.map((e) => e[end])).map((x, n) => [`${bone}_${"xyz"[n]}_mm`, x]));
    /** @type {(string | number)[][]} */
    const all = [["name", g.name], ["stiffness_n_per_mm", g.stiffness_n_per_mm], ...Object.entries(g.drawn), ...ends];
    if (fixed) all.push(["length_in_ct_mm", fixed.length_mm], ["slack_length_as_fixed_mm", fixed.slack_length_mm]);
    return all.map(([what, value]) => [`graft${k}_${what}`, value]);
  }

  /** The grafts in the page's axes, two ends a fibre, as the picture has them. @type {(grafts: LiveGraft[], about: LiveAbout) => Triple[]} */
  const lines = (grafts, about) => { const page = back(about.ct); return grafts.flatMap((g) => g.ends.flatMap((e) => e.map(page))); };
  return { controls, restored, rows, lines };
})();
