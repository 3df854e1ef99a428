"use strict";
(() => {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const button = document.getElementById("theme");
  const plots = [...document.querySelectorAll(".plot")];
  let page;  // figures and templates, once they are unpacked
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
    for (const plot of plots) if (plot.dataset.drawn) draw(plot);
  };
  button.addEventListener("click", () => { chosen = dark() ? "light" : "dark"; store(chosen); setTheme(); });
  system.addEventListener("change", setTheme);

  const config = { responsive: true, displaylogo: false, displayModeBar: false };
  const hiddenGroups = (plot) => new Set(
    [...plot.closest("figure").querySelectorAll('.legend button[aria-pressed="false"]')].map((b) => b.dataset.group));

  const set = (values, path, value) => {  // at a dotted path
    const keys = path.split(".");
    const last = keys.pop();
    keys.reduce((at, key) => (at[key] ??= {}), values)[last] = value;
  };
  function draw(plot) {
    if (!page) return;
    const figure = page.figures[plot.id];
    const style = getComputedStyle(root);
    const hidden = hiddenGroups(plot);
    const data = figure.data.map((line) => ({ ...line, visible: !hidden.has(line.legendgroup) }));
    const layout = {
      ...structuredClone(figure.layout),
      template: page.templates[root.dataset.theme], colorway: data.map((line) => style.getPropertyValue(`--${line.meta}`).trim()),
      font: { family: getComputedStyle(document.body).fontFamily },
      dragmode: narrow.matches ? false : "zoom",  // a finger scrolls the page
      uirevision: "keep",
    };
    if (narrow.matches) for (const [path, value] of Object.entries(figure.narrow)) set(layout, path, value);
    Plotly.react(plot, data, layout, config).then(() => {
      plot.dataset.drawn = "yes";
      plot.closest("figure").querySelector(".save").hidden = false;
    });
  }

  // The library and the figures are packed: gzip in base 85, of which a comma stands for "<".
  const digits = new Uint8Array(128);
  [..."0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;,=>?@^_`{|}~"].forEach(
    (character, k) => { digits[character.charCodeAt(0)] = k; });
  const decoded = (text) => {
    const missing = (5 - text.length % 5) % 5;
    const whole = text + "~".repeat(missing);
    const words = new DataView(new ArrayBuffer(whole.length / 5 * 4));
    for (let k = 0; k < whole.length; k += 5) {
      let word = 0;
      for (let n = k; n < k + 5; n += 1) word = word * 85 + digits[whole.charCodeAt(n)];
      words.setUint32(k / 5 * 4, word);
    }
    return new Uint8Array(words.buffer, 0, words.byteLength - missing);
  };
  const unpacked = async (name) => {
    const bytes = decoded(document.getElementById(name).textContent);
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  };
  const ready = (async () => {
    const [library, data] = await Promise.all([unpacked("plotly"), unpacked("figures")]);
    document.head.append(Object.assign(document.createElement("script"), { textContent: library }));
    const found = JSON.parse(data);
    for (const figure of Object.values(found.figures)) {
      for (const line of figure.data) if (typeof line.x === "number") line.x = figure.arrays[line.x];
    }
    page = found;
  })();
  ready.catch(() => { document.getElementById("no-plots").hidden = false; });

  const near = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      near.unobserve(entry.target);
      ready.then(() => draw(entry.target), () => {});
    }
  }, { rootMargin: "600px 0px" });
  for (const plot of plots) near.observe(plot);
  const drawAll = () => { for (const plot of plots) if (!plot.dataset.drawn) { near.unobserve(plot); ready.then(() => draw(plot), () => {}); } };

  for (const save of document.querySelectorAll(".save")) {
    save.addEventListener("click", () => {
      const figure = save.closest("figure");
      const filename = figure.querySelector("figcaption b").textContent;
      Plotly.downloadImage(figure.querySelector(".plot"), { format: "svg", filename });
    });
  }

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
