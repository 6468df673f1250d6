// What the live view says: names of ligaments, flags, samples, in plain words.
"use strict";
const liveWords = (() => {
  /** What the names of a knee's ligaments stand for. @type {Record<string, string>} */
  const NAMES = {
    ACL: "anterior cruciate ligament", PCL: "posterior cruciate ligament", LCL: "lateral collateral ligament", sMCL: "superficial medial collateral ligament", dMCL: "deep medial collateral ligament",
    ALS: "anterolateral structures", PFL: "popliteofibular ligament", POL: "posterior oblique ligament", PCAP: "posterior capsule",
  };
  /** The flags of sim/src/flag.rs. @type {Record<string, string>} */
  const FLAGS = {
    subluxed: "One compartment bears at the rim of its plateau, or next to nothing with the tibia far from the CT pose.", "rotated beyond any knee": "The tibia is turned or opened further than knees are.",
    dislocated: "The femur has left the plateau: the model does not know what comes next.",
    "several equilibria": "Under the same loads the knee may rest in another place, too.",
    "no equilibrium": "No pose was found in which all forces cancel.", "still moving": "The knee has not come to rest.",
    "patella out of balance": "The patella's forces do not balance.", "patella off the groove": "The patella lies beside its groove, or in the notch.",
    "patellar tendon beyond the pull of the quadriceps": "The retinacula hold the patella: its tendon bears more than the muscle pulls.",
    "patella snaps": "The patella rests elsewhere a degree of flexion further, or where it comes from the other side.",
    "explicit dynamics stopped early: the quasi-static answer": "The solver in time was stopped early: this is the answer without inertia.",
  };
  /** @type {(f: string) => string} */
  const flag = (f) => {
    const torn = f.match(/^(.+) beyond its failure load$/), without = f.match(/^unloaded: (.+)$/);
    return torn ? `${torn[1]} bears more than the load at which such a ligament fails.` : without ? `Without load: ${flag(without[1])}` : FLAGS[f] || `${f[0].toUpperCase()}${f.slice(1)}.`;
  };

  // "3 of 32 samples are subluxed" as "3 are subluxed", "1 is subluxed"
  /** @type {Record<string, string>} */
  const SINGULAR = { are: "is", rest: "rests", leave: "leaves", have: "has", stay: "stays" };
  /** @type {(n: number, verb: string, rest: string) => string} */
  const counted = (n, verb, rest) => `${n} ${n === 1 ? SINGULAR[verb] || verb : verb} ${rest}`;
  /** @type {(text: string) => string} */
  const differs = (text) => { const found = text.match(/^(\d+) of \d+ samples (\S+) (.*)$/); return found ? counted(Number(found[1]), found[2], found[3]) : text; };
  /** What is told of intervals; `share` is the probability that one holds. @type {(told: LiveBands, share: number, isOff: boolean) => string} */
  const intervals = ({ asked, lost, leaving, differing = [], bands }, share, isOff) => {
    const here = asked - lost - leaving, out = [];
    if (leaving) out.push(counted(leaving, "leave", "the plateau"));
    if (lost) out.push(counted(lost, "have", "no equilibrium"));
    if (isOff) return "No intervals: the femur has left the plateau.";
    if (!Object.keys(bands).length) return `No intervals are shown: of ${asked} samples ${out.join(" and ")}.`;
    if (differing.length) out.push(`${out.length ? `of the ${here} that count ` : ""}${differing.map(differs).join(" and ")}`);
    return `${Math.round(100 * share)} % intervals by ${here === asked ? "" : `${here} of `}${asked} samples of the calibration${out.length ? `: ${out.join(", ")}` : ""}.`;
  };

  return { NAMES, flag, intervals };
})();
