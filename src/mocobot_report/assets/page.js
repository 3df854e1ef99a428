"use strict";
(() => {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const button = document.getElementById("theme");
  const figures = new Map();  // element -> its data, for drawing again in another theme
  const narrow = matchMedia("(max-width: 40rem)");

  // Theme: the system's until the button is used.
  const stored = () => { try { return localStorage.getItem("mocobot-theme"); } catch { return null; } };
  const store = (value) => { try { localStorage.setItem("mocobot-theme", value); } catch { /* not kept */ } };
  let chosen = stored();
  let printing = false;
  const dark = () => !printing && (chosen ? chosen === "dark" : system.matches);
  const setTheme = () => {
    root.dataset.theme = dark() ? "dark" : "light";
    button.textContent = dark() ? "Light theme" : "Dark theme";
    for (const plot of figures.keys()) if (plot.dataset.drawn) draw(plot);
  };
  button.addEventListener("click", () => { chosen = dark() ? "light" : "dark"; store(chosen); setTheme(); });
  system.addEventListener("change", setTheme);

  const config = {
    responsive: true, displaylogo: false, displayModeBar: !narrow.matches && "hover",
    modeBarButtons: [["toImage"], ["zoom2d", "pan2d"], ["resetScale2d"]],  // none that sends anything anywhere
    toImageButtonOptions: { format: "svg" },
  };
  const hiddenGroups = (plot) => new Set(
    [...plot.closest("figure").querySelectorAll('.legend button[aria-pressed="false"]')].map((b) => b.dataset.group));

  const set = (values, path, value) => {  // at a dotted path
    const keys = path.split(".");
    const last = keys.pop();
    keys.reduce((at, key) => (at[key] ??= {}), values)[last] = value;
  };
  function draw(plot) {
    const figure = figures.get(plot);
    const style = getComputedStyle(root);
    const hidden = hiddenGroups(plot);
    const data = figure.data.map((line) => ({ ...line, visible: !hidden.has(line.legendgroup) }));
    const layout = {
      ...structuredClone(figure.layout),
      template: templates[root.dataset.theme], colorway: data.map((line) => style.getPropertyValue(`--${line.meta}`).trim()),
      font: { family: getComputedStyle(document.body).fontFamily },
      dragmode: narrow.matches ? false : "zoom",  // a finger scrolls the page
      uirevision: "keep",
    };
    if (narrow.matches) for (const [path, value] of Object.entries(figure.narrow)) set(layout, path, value);
    Plotly.react(plot, data, layout, config).then(() => { plot.dataset.drawn = "yes"; });
  }
  const block = (name) => JSON.parse(document.getElementById(name).textContent);
  const templates = block("templates");
  for (const plot of document.querySelectorAll(".plot")) {
    const figure = block(plot.dataset.figure);
    for (const line of figure.data) if (typeof line.x === "number") line.x = figure.arrays[line.x];
    figures.set(plot, figure);
  }
  const near = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      near.unobserve(entry.target);
      draw(entry.target);
    }
  }, { rootMargin: "600px 0px" });
  for (const plot of figures.keys()) near.observe(plot);
  const drawAll = () => { for (const plot of figures.keys()) if (!plot.dataset.drawn) { near.unobserve(plot); draw(plot); } };

  for (const toggle of document.querySelectorAll(".legend button")) {
    toggle.addEventListener("click", () => {
      toggle.setAttribute("aria-pressed", toggle.getAttribute("aria-pressed") === "true" ? "false" : "true");
      const plot = toggle.closest("figure").querySelector(".plot");
      if (plot.dataset.drawn) draw(plot);
    });
  }

  // One panel of several at a time.
  const show = (tabs) => {
    for (const input of tabs.querySelectorAll("input")) {
      document.getElementById(input.value).hidden = !input.checked;
    }
  };
  for (const tabs of document.querySelectorAll(".tabs")) {
    show(tabs);
    tabs.addEventListener("change", () => show(tabs));
  }
  addEventListener("beforeprint", () => {
    printing = true;  // on white paper
    setTheme();
    for (const panel of document.querySelectorAll("[data-panel]")) panel.hidden = false;
    for (const part of document.querySelectorAll("details")) part.open = true;
    drawAll();
  });
  addEventListener("afterprint", () => {
    printing = false;
    setTheme();
    for (const tabs of document.querySelectorAll(".tabs")) show(tabs);
  });

  // A table that is wider than its place can be scrolled with the keyboard, and shows on which side it goes on.
  const hint = (box) => {
    box.classList.toggle("more", box.scrollLeft + box.clientWidth < box.scrollWidth - 2);
    box.classList.toggle("before", box.scrollLeft > 2);
  };
  const reachable = () => {
    for (const box of document.querySelectorAll(".scroll")) {
      if (box.scrollWidth > box.clientWidth + 1) box.tabIndex = 0; else box.removeAttribute("tabindex");
      hint(box);
    }
  };
  for (const box of document.querySelectorAll(".scroll")) {
    box.querySelector("caption").append(Object.assign(document.createElement("span"), {
      className: "swipe", textContent: "\u2194 more columns: scroll sideways" }));
    box.addEventListener("scroll", () => hint(box), { passive: true });
  }
  new ResizeObserver(reachable).observe(document.body);

  // Where in the page the reader is.
  const links = new Map([...document.querySelectorAll("nav a")].map((a) => [a.hash.slice(1), a]));
  const spy = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      for (const a of links.values()) a.removeAttribute("aria-current");
      links.get(entry.target.id).setAttribute("aria-current", "true");
    }
  }, { rootMargin: "-10% 0px -80% 0px" });
  for (const id of links.keys()) { const part = document.getElementById(id); if (part) spy.observe(part); }

  setTheme();
})();
