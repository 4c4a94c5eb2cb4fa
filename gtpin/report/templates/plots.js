"use strict";
// Draws the page's figures. A figure's colour is one of the light palette; the page's --name is drawn, so that figures
// follow light, dark and print. {"ref": 3} is the part of that number, which figures share.
(function () {
  const blocks = document.querySelectorAll("script[data-plot]");
  const shared = JSON.parse(document.getElementById("shared").textContent);
  const choices = [...document.querySelectorAll("[data-choice]")];
  const choice = (name) => choices.find((one) => one.dataset.choice === name);
  const resolved = (value, css, color) => {
    if (typeof value === "string")
      return color && Object.hasOwn(shared.palette, value) ? css.getPropertyValue("--" + shared.palette[value]).trim() : value;
    if (Array.isArray(value)) return value.map((one) => resolved(one, css, color));
    if (value && typeof value === "object") {
      if (Object.hasOwn(value, "ref")) {
        const part = shared.parts[value.ref];
        return Array.isArray(part) ? part : resolved(part, css, color);
      }
      const colored = (key) => key.endsWith("color") || key === "colorscale" || key === "colorway";
      return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, resolved(one, css, colored(key))]));
    }
    return value;
  };
  const config = { responsive: true, displaylogo: false, displayModeBar: "hover", scrollZoom: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };
  const draw = (block) => {
    const css = getComputedStyle(document.documentElement), narrow = window.innerWidth < 736;
    const plot = JSON.parse(block.textContent);
    // One figure for each combination of options; those of the last choice vary fastest.
    const number = plot.follows.reduce((all, [name, count]) => all * count + Math.max(choice(name)?.selectedIndex ?? 0, 0), 0);
    const figure = resolved(plot.figures[number], css, false);
    figure.layout.template = { layout: resolved(shared.look, css, false) };
    if (narrow) figure.layout.margin = Object.assign({ l: 48 }, figure.layout.margin);
    return Plotly.react(document.getElementById("plot-" + block.dataset.plot), figure.data, figure.layout, config);
  };
  // One plot at a time, so that the page can be read and scrolled meanwhile; `data-drawn` tells when all are there.
  let round = 0;
  const drawAll = async () => {
    const mine = ++round;
    document.documentElement.removeAttribute("data-drawn");
    for (const block of blocks) {
      await new Promise((next) => setTimeout(next));
      if (mine !== round) return;
      await draw(block);
    }
    document.documentElement.dataset.drawn = round;
  };
  // Paper does not wait.
  const drawNow = () => {
    round++;
    blocks.forEach(draw);
    document.documentElement.dataset.drawn = round;
  };
  drawAll();
  // Selects of one name show one choice, wherever they stand.
  for (const one of choices)
    one.addEventListener("change", () => {
      for (const other of choices) if (other.dataset.choice === one.dataset.choice) other.value = one.value;
      drawAll();
    });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  matchMedia("print").addEventListener("change", drawNow);
})();
