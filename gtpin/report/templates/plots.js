"use strict";
// Draws the page's plots in its colours. A colour "@name" in a plot is the page's --name; so plots follow light, dark, print.
(function () {
  const blocks = document.querySelectorAll("script[data-plot]");
  const style = () => getComputedStyle(document.documentElement);
  const colored = (value, css) => {
    if (typeof value === "string") return value[0] === "@" ? css.getPropertyValue("--" + value.slice(1)).trim() : value;
    if (Array.isArray(value)) return value.map((one) => colored(one, css));
    if (value && typeof value === "object")
      return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, colored(one, css)]));
    return value;
  };
  const axis = { gridcolor: "@line", zerolinecolor: "@zero", linecolor: "@line", automargin: true, title: { standoff: 8 } };
  const look = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", colorway: ["@accent", "@fit", "@good", "@mystery", "@warn", "@bad"],
    font: { family: "system-ui, sans-serif", size: 12, color: "@ink" }, xaxis: axis, yaxis: axis,
    hoverlabel: { bgcolor: "@panel", bordercolor: "@line", font: { color: "@ink" } },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
  };
  const config = { responsive: true, displaylogo: false, displayModeBar: "hover", scrollZoom: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };
  const draw = () => {
    const css = style(), narrow = window.innerWidth < 736;
    for (const block of blocks) {
      const plot = colored(JSON.parse(block.textContent), css);
      plot.layout.template = { layout: colored(look, css) };
      plot.layout.margin = Object.assign({ l: narrow ? 44 : 56, r: 12, t: 36, b: 44 }, plot.layout.margin);
      Plotly.react(document.getElementById("plot-" + block.dataset.plot), plot.data, plot.layout, config);
    }
  };
  draw();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  matchMedia("print").addEventListener("change", draw);
})();
