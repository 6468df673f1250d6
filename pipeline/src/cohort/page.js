// Draws the strips of a cohort when they come into view.
"use strict";
(() => {
  const plots = JSON.parse(document.getElementById("data").textContent);
  const draw = (place) => {
    const { data, layout } = plots[Number(place.id.slice("strip-".length))];
    const narrow = place.clientWidth < 500;
    const margin = { l: 55, r: 10, t: 10, b: narrow ? 90 : 60 };
    const xaxis = { ...layout.xaxis, tickangle: layout.xaxis.ticktext.length > (narrow ? 3 : 6) ? -45 : 0 };
    Plotly.newPlot(place, data, { ...layout, xaxis, margin, height: place.clientHeight, hovermode: "closest" }, { responsive: true, displayModeBar: false });
  };
  const seen = new IntersectionObserver((entries) => {
    for (const e of entries.filter((e) => e.isIntersecting)) {
      seen.unobserve(e.target);
      draw(e.target);
    }
  }, { rootMargin: "400px" });
  document.querySelectorAll(".chart").forEach((place) => seen.observe(place));
})();
