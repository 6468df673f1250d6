// The live picture while the knee is pulled at: drawn fast rather than fine.
"use strict";
const liveDraft = (() => {
  const SLOW_MS = 40; // a picture that takes longer is drawn with fewer corners meanwhile
  const ROUGH = { edges: 2.5, ratio: 0.5 }; // mean edges of a surface that become one then, about a sixth of its triangles, and pixels for one of the screen
  const FINE = 2; // pixels each way for one of the screen, as plotly.js draws

  /** @type {(view: LiveView) => any} */
  const drawnBy = (view) => ((view.plot._fullLayout.scene || {})._scene || {}).glplot;

  /** How long a picture takes; what is read must have been drawn [ms]. @type {(glplot: any) => number} */
  function takes(glplot) {
    const begin = performance.now(), { gl } = glplot;
    glplot.redraw();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    return performance.now() - begin;
  }

  // as many pixels as the screen has; and fewer pixels and corners where a picture takes long all the same, as where the processor draws
  /** @type {(view: LiveView) => void} */
  function begin(view) {
    const glplot = drawnBy(view);
    if (!glplot || view.drafting) return;
    view.drafting = true;
    glplot.pixelRatio = Math.max(1, Math.min(FINE, devicePixelRatio));
    view.rough = view.byProcessor || takes(glplot) > SLOW_MS ? ROUGH.edges : 0;
    if (view.rough) glplot.pixelRatio *= ROUGH.ratio;
    view.again();
  }

  /** @type {(view: LiveView) => void} */
  function end(view) {
    const glplot = drawnBy(view);
    if (!glplot || !view.drafting) return;
    view.drafting = false;
    view.rough = 0;
    glplot.pixelRatio = FINE;
    view.again();
  }

  return { begin, end };
})();
