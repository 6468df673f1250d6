// The report's surfaces and lines: unpacked, moved, and as lists for plotly.js. No drawing.
"use strict";
const geometry = (() => {
  const AXES = ["x", "y", "z"];
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

  const unpacked = new Map();
  function surface(data, pool, name) {
    const key = pool + "/" + name;
    if (!unpacked.has(key)) {
      const m = data[pool].meshes[name];
      const steps = new Uint16Array(bytes(m.corners).buffer);
      const indices = new (m.wide ? Uint32Array : Uint16Array)(bytes(m.triangles).buffer);
      const every3 = (from, k, value) => from.filter((_, n) => n % 3 === k).map(value);
      const [x, y, z] = [0, 1, 2].map((k) => Float32Array.from(every3(steps, k, (s) => s), (s) => m.low[k] + m.step[k] * s));
      const [i, j, k] = [0, 1, 2].map((c) => Uint32Array.from(every3(indices, c, (s) => s)));
      unpacked.set(key, { x, y, z, i, j, k });
    }
    return unpacked.get(key);
  }

  function moved(s, m) {
    const out = { x: new Float32Array(s.x.length), y: new Float32Array(s.x.length), z: new Float32Array(s.x.length) };
    for (let n = 0; n < s.x.length; n++) {
      AXES.forEach((axis, r) => {
        out[axis][n] = m[4 * r] * s.x[n] + m[4 * r + 1] * s.y[n] + m[4 * r + 2] * s.z[n] + m[4 * r + 3];
      });
    }
    return out;
  }

  // a surface of fewer corners, for a picture that changes at once: those of a cell of `edges` mean edges become one. `of` numbers them on the surface
  function coarse(s, edges) {
    let sum = 0, tried = 0;
    for (let t = 0; t < s.i.length; t += 17, tried++) sum += Math.hypot(...AXES.map((axis) => s[axis][s.i[t]] - s[axis][s.j[t]]));
    const cell = (edges * sum) / Math.max(1, tried) || 1, first = new Map(), of = [];
    const merged = Uint32Array.from(s.x, (_, n) => {
      const key = AXES.map((axis) => Math.floor(s[axis][n] / cell)).join();
      if (!first.has(key)) first.set(key, of.push(n) - 1);
      return first.get(key);
    });
    const kept = [...s.i.keys()].map((t) => [merged[s.i[t]], merged[s.j[t]], merged[s.k[t]]]).filter(([a, b, c]) => a !== b && b !== c && c !== a);
    const [x, y, z] = AXES.map((axis) => Float32Array.from(of, (n) => s[axis][n]));
    const [i, j, k] = [0, 1, 2].map((c) => Uint32Array.from(kept, (t) => t[c]));
    return { x, y, z, i, j, k, of };
  }

  /** Numbers by axis; null breaks a line. @type {() => Record<string, (number | null)[]>} */
  const lists = () => ({ x: [], y: [], z: [] });
  const apply = (p, m) => [0, 1, 2].map((r) => m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3]);

  // ends of lines, broken after every second; with a number a line where there are any. Of a cut line two stumps are left
  const STUMP = 0.25;
  function segments(lines, m, force, cut) {
    const out = { ...lists(), color: lists().x };
    const put = (a, b, f) => {
      AXES.forEach((axis, k) => out[axis].push(a[k], b[k], null));
      out.color.push(f, f, f);
    };
    for (let n = 0; n < lines.length; n += 2) {
      const a = m ? apply(lines[n], m) : lines[n], b = lines[n + 1], f = force ? force[n / 2] : 0;
      const along = (share) => a.map((x, k) => x + share * (b[k] - x));
      if (cut && cut.has(n / 2)) { put(a, along(STUMP), f); put(along(1 - STUMP), b, f); } else put(a, b, f);
    }
    return out;
  }

  // edges of quads whose two triangles follow each other, each once
  function quadEdges(s) {
    const out = lists(), seen = new Set();
    for (let t = 0; t + 1 < s.i.length; t += 2) {
      const ring = [s.i[t], s.j[t], s.k[t], s.k[t + 1]];
      ring.forEach((a, n) => {
        const b = ring[(n + 1) % 4], key = Math.min(a, b) * 4294967 + Math.max(a, b);
        if (seen.has(key)) return;
        seen.add(key);
        AXES.forEach((axis) => out[axis].push(s[axis][a], s[axis][b], null));
      });
    }
    return out;
  }

  // where names stand: in the middle of each line, pushed outwards from the middle of all
  function middles(lines, m) {
    const out = lists(), all = [];
    for (let n = 0; n < lines.length; n += 2) {
      const a = m ? apply(lines[n], m) : lines[n];
      all.push(a.map((v, k) => (v + lines[n + 1][k]) / 2));
    }
    const centre = [0, 1, 2].map((k) => all.reduce((sum, p) => sum + p[k], 0) / all.length);
    const places = all.map((p) => {
      const [dx, dy] = [p[0] - centre[0], p[1] - centre[1]], far = Math.hypot(dx, dy) || 1;
      return [p[0] + (16 * dx) / far, p[1] + (16 * dy) / far, p[2]];
    });
    // names of one side stand below each other, at least a line apart, mm
    for (const side of [-1, 1]) {
      const own = places.filter((p) => (p[0] < centre[0] ? -1 : 1) === side).sort((a, b) => b[2] - a[2]);
      own.forEach((p, n) => { if (n) p[2] = Math.min(p[2], own[n - 1][2] - 8); });
    }
    for (const p of places) AXES.forEach((axis, k) => out[axis].push(p[k]));
    return out;
  }

  // the box around all that is drawn, and around where a motion takes it
  function bounds(traces, motion) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const grow = (k, v) => { if (v !== null) { low[k] = Math.min(low[k], v); high[k] = Math.max(high[k], v); } };
    for (const t of traces) AXES.forEach((axis, k) => t[axis].forEach((v) => grow(k, v)));
    if (motion) {
      const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((n) => [0, 1, 2].map((k) => ((n >> k) & 1 ? high[k] : low[k])));
      // the far end of a long bone may leave the picture; a third of its reach does not
      const reach = motion.flatMap((m) => m.steps).flatMap((s) => corners.map((c) => apply(c, s.femur)));
      for (const p of reach) p.forEach((v, k) => grow(k, Math.max(low[k] - 60, Math.min(high[k] + 60, v))));
    }
    return { low: low.map((v) => v - 1), high: high.map((v) => v + 1) };
  }

  // pressure at every corner of a surface: the few that are pressed are told
  function pressures(data, pool, layer, step, high) {
    const out = new Float32Array(surface(data, pool, layer.mesh).x.length);
    const told = step && step.pressure && step.pressure[layer.mesh];
    if (told) {
      const at = new Uint16Array(bytes(told[0]).buffer), value = bytes(told[1]);
      at.forEach((corner, n) => { out[corner] = (high * value[n]) / 255; });
    }
    for (const [corner, mpa] of (step && step.pressed && step.pressed[layer.mesh]) || []) out[corner] = mpa;
    return out;
  }

  return { AXES, bytes, surface, coarse, apply, moved, segments, quadEdges, middles, bounds, pressures };
})();
