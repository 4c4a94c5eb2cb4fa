// Equations of the pages: pymdownx.arithmatex marks them, KaTeX 0.16.47 (MIT, beside this file) sets them. Nothing is fetched from elsewhere.
for (const element of document.querySelectorAll(".arithmatex")) {
  const block = element.tagName === "DIV";
  const source = element.textContent.trim().slice(2, -2); // between \( \) or \[ \]
  katex.render(source, element, { displayMode: block });
}
