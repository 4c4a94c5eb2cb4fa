"use strict";
// Draws the page's plots in its colours. A colour "@name" in a plot is the page's --name; so plots follow light, dark, print.
(function () {
  const blocks = document.querySelectorAll("script[data-plot]");
  const style = () => getComputedStyle(document.documentElement);
  const columns = JSON.parse(document.getElementById("columns").textContent);
  const choices = [...document.querySelectorAll("[data-choice]")];
  const chosen = (text, label) => text.replace(/\{(\w+)\}/g, (all, name) => {
    const choice = choices.find((one) => one.dataset.choice === name);
    if (!choice) return all;
    return label ? choice.dataset.label || choice.selectedOptions[0].textContent : choice.value;
  });
  // Text that names no color, column or choice is itself.
  const told = (text, css) => {
    if (text[0] === "@") return css.getPropertyValue("--" + text.slice(1)).trim() || text;
    if (text[0] === "$" && text.includes("{")) return chosen(text.slice(1), true);
    const name = text[0] === "#" ? chosen(text.slice(1), false) : "";
    return Object.hasOwn(columns, name) ? columns[name] : text;
  };
  const colored = (value, css) => {
    if (typeof value === "string") return told(value, css);
    if (Array.isArray(value)) return value.map((one) => colored(one, css));
    if (value && typeof value === "object")
      return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, colored(one, css)]));
    return value;
  };
  const axis = { gridcolor: "@line", zerolinecolor: "@zero", linecolor: "@line", title: { standoff: 8 } };
  const look = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", colorway: ["@accent", "@fit", "@good", "@mystery", "@warn", "@bad"],
    font: { family: "system-ui, sans-serif", size: 12, color: "@ink" }, xaxis: axis, yaxis: axis,
    hoverlabel: { bgcolor: "@panel", bordercolor: "@line", font: { color: "@ink" } },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
  };
  const config = { responsive: true, displaylogo: false, displayModeBar: "hover", scrollZoom: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };
  const draw = (block) => {
    const css = style(), narrow = window.innerWidth < 736;
    const plot = colored(JSON.parse(block.textContent), css);
    plot.layout.template = { layout: colored(look, css) };
    plot.layout.margin = Object.assign({ l: narrow ? 48 : 58, r: 12, t: 36, b: 46 }, plot.layout.margin);
    return Plotly.react(document.getElementById("plot-" + block.dataset.plot), plot.data, plot.layout, config);
  };
  // Words that hold for one option of a choice alone: data-when="choice=option".
  const tell = () => document.querySelectorAll("[data-when]").forEach((words) => {
    const [name, option] = words.dataset.when.split("=");
    words.hidden = chosen("{" + name + "}", false) !== option;
  });
  // One plot at a time, so that the page can be read and scrolled meanwhile; `data-drawn` tells when all are there.
  let round = 0;
  const drawAll = async () => {
    const mine = ++round;
    tell();
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
  for (const choice of choices)
    choice.addEventListener("change", () => {
      for (const other of choices) if (other.dataset.choice === choice.dataset.choice) other.value = choice.value;
      drawAll();
    });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  matchMedia("print").addEventListener("change", drawNow);
})();
