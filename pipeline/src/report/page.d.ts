// What the page's scripts hand each other, for the check of types (tests/live.rs). No part of a page.
// Replies are those of live/src/knee.rs; the test holds them against what the library answers.

type Triple = [number, number, number];

/** A graft as it is asked for; ends in CT [mm]. */
interface LiveGraft {
  name: string;
  ends: [Triple, Triple][];
  stiffness_n_per_mm: number;
  toe_strain?: number;
  like?: string | null;
  drawn: { tension_n: number; at_flexion_deg: number; compression_n?: number } | { slack_length_mm: number };
}

/** Loads of a state: vv and ie [N m], the others [N]; flexion [deg]. */
type LiveLoad = "flexion" | "vv" | "ie" | "ml" | "ap" | "si";

/** What the reader has set. */
interface LiveState extends Record<LiveLoad, number> {
  cut: string[];
  strain: Record<string, number>;
  stiffness: Record<string, number>;
  grafts: LiveGraft[];
}

/** A slider. */
interface LiveSlider { key: LiveLoad; words: string; unit: "deg" | "N" | "N m"; least: number; most: number; step: number; taken?: [number, number] }

/** What is asked of the solver. */
interface LiveAsked {
  flexion_deg: number;
  load: [number, number, number, number, number];
  cut: string[];
  strain: Record<string, number>;
  stiffness: Record<string, number>;
  grafts: LiveGraft[];
}

/** What the knee is. */
interface LiveAboutKnee {
  id: string;
  bundles: { name: string; reference_strain: number; stiffness_n_per_mm: number }[];
  ct_flexion_deg: number;
  flexion_deg: [number, number];
  samples: number;
  interval: number;
  side: "left" | "right";
  fibres: number[];
  ct: number[];
  graft: { stiffness_n_per_mm: number; stiffnesses_n_per_mm: [number, number]; tension_n: number; tensions_n: [number, number] };
}

/** Where there is no answer: why; `broken` where nothing more will come of this worker. */
interface LiveFault { fault?: string; broken?: boolean }

/** The same with what the worker reads of the pack: columns and their ends. */
interface LiveAbout extends LiveAboutKnee, LiveFault { reach: Record<string, [number, number]> | null }

/** An answer. */
interface LiveTold {
  pose: Record<"fe_deg" | "vv_deg" | "ie_deg" | "ml_mm" | "ap_mm" | "si_mm", number>;
  forces_n: number[];
  strains: (number | null)[];
  outputs: [string, number][];
  flags: string[];
  femur: number[];
  fibres_n: number[];
  pressure: Record<string, [number, number][]>;
  grafts: { length_mm: number; slack_length_mm: number }[];
  evaluations: number;
}
interface LiveReply extends LiveTold, LiveFault {}

interface LiveBand { mean: number; lower: number; upper: number }
/** Means and intervals by samples. */
interface LiveBands {
  bands: Record<string, LiveBand>;
  asked: number;
  lost: number;
  leaving: number;
  differing: string[];
}

/** What a picture of a moved knee is made of. */
interface LiveStep { femur: number[]; force: number[]; pressed: Record<string, [number, number][]>; grafts: Triple[]; cut: Set<number>; label: string }

interface LiveRay { from: Triple; along: Triple }
/** Corners by axis, triangles by corner. */
interface LiveSurface extends Record<"x" | "y" | "z" | "i" | "j" | "k", ArrayLike<number>> {}
/** A place on a bone, and how far ahead it lies [mm]. */
interface LiveBone { name: string; point: Triple; depth: number }
/** Force [N] and moment [N m] in the page's axes. */
interface LivePull { force: Triple; moment: Triple }

/** The view of the picture, as far as the live scripts use it (viewer.js). */
interface LiveView {
  closed?: boolean;
  drafting: boolean;
  rough: number;
  byProcessor: boolean;
  most: { n: number; mpa: number } | null;
  eye: Triple;
  middle: Triple;
  up: Triple;
  size: number;
  box: { low: number[]; high: number[] };
  scene: { layers: { name: string; mesh?: string; edges?: boolean; moves?: string }[] };
  boxes: HTMLInputElement[];
  ends?: Triple[];
  range(): number[][];
  solid(n: number): LiveSurface;
  plot: any;
  frame: HTMLElement;
  figure: HTMLElement;
  place(step: LiveStep, high?: number): void;
  again(): void;
}

/** plotly.js; its own types are a package of their own, and the page calls few of its functions. */
declare const Plotly: Record<"newPlot" | "restyle" | "relayout" | "purge" | "downloadImage", (...given: any[]) => any>;

// A page is written by the program together with its scripts: what they look for is there.
interface ParentNode {
  querySelector(selectors: string): any;
  querySelectorAll(selectors: string): NodeListOf<any>;
}
interface Document {
  getElementById(id: string): any;
}
