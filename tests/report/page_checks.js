"use strict";
// What tests ask of a page that is open in a browser.
window.checks = {
  // Show every panel and detail, and scroll past everything.
  async drawAll() {
    for (const part of document.querySelectorAll("details")) part.open = true;
    for (const panel of document.querySelectorAll("[data-panel]")) panel.hidden = false;
    for (let y = 0; y < document.documentElement.scrollHeight; y += 600) {
      scrollTo({ top: y, behavior: "instant" });
      await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 0)));
    }
    scrollTo({ top: 0, behavior: "instant" });
  },

  // Texts whose contrast to what is behind them is below 4.5, by WCAG 2.2.
  contrast() {
    const channel = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const parts = (colour) => {
      const n = colour.match(/[\d.]+/g).map(Number);
      return { rgb: n.slice(0, 3), alpha: n.length > 3 ? n[3] : 1 };
    };
    const luminance = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
    const behind = (element) => {
      for (let at = element; at; at = at.parentElement) {
        const { rgb, alpha } = parts(getComputedStyle(at).backgroundColor);
        if (alpha === 1 && !(at instanceof SVGElement)) return rgb;
      }
      return [255, 255, 255];
    };
    const bad = [];
    let count = 0;
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
      const element = walker.currentNode.parentElement;
      if (!walker.currentNode.data.trim() || element.closest("script,style,noscript,.skip")) continue;
      if (!element.getClientRects().length) continue;
      const style = getComputedStyle(element);
      const colour = element instanceof SVGElement ? style.fill : style.color;
      if (colour === "none" || element.closest(".bartext-inside")) continue;
      const [a, b] = [luminance(parts(colour).rgb), luminance(behind(element))].sort((x, y) => y - x);
      const ratio = (a + 0.05) / (b + 0.05);
      count += 1;
      if (ratio < 4.5) bad.push([walker.currentNode.data.trim().slice(0, 40), ratio.toFixed(2), colour]);
    }
    return { bad, count };
  },

  // How many marks every plot has, and texts of its axes that are cut off.
  plots() {
    return [...document.querySelectorAll(".plot")].map((plot) => {
      const box = plot.getBoundingClientRect();
      const points = plot.querySelectorAll(".point path, path.point").length;
      const lines = [...plot.querySelectorAll(".js-line")].filter((p) => (p.getAttribute("d") || "").length > 8).length;
      const outside = [...plot.querySelectorAll(".xtitle, .ytitle, .ytick text, .xtick text")].filter((text) => {
        const b = text.getBoundingClientRect();
        return b.width && (b.left < box.left - 1 || b.right > box.right + 1 || b.bottom > box.bottom + 1);
      });
      return { name: plot.getAttribute("aria-label"), drawn: points + lines, outside: outside.map((t) => t.textContent) };
    });
  },

  // Landmarks, and counts of what is wrong with headings, names, ids and links.
  markup() {
    const all = (css) => [...document.querySelectorAll(css)];
    const ids = all("[id]").map((e) => e.id);
    const levels = all("h1,h2,h3,h4,h5,h6").map((h) => +h.tagName[1]);
    const unnamed = (i) => !i.labels.length || !i.closest("fieldset").querySelector("legend");
    return {
      h1: all("h1").length, main: all("main").length, nav: all("nav[aria-label]").length,
      lang: document.documentElement.lang,
      twice: ids.filter((id, k) => ids.indexOf(id) !== k),
      skipped: levels.filter((level, k) => k && level > levels[k - 1] + 1),
      captions: all("table").filter((t) => !t.caption || !t.caption.textContent.trim()).length,
      scopes: all("th:not([scope])").length,
      alts: all("img").filter((i) => i.alt.length < 10).length,
      plots: all(".plot").filter((p) => p.getAttribute("role") !== "img" || !p.ariaLabel).length,
      inputs: all("input").filter(unnamed).length,
      broken: all('a[href^="#"]').filter((a) => !document.getElementById(a.hash.slice(1))).length,
    };
  },

  // What has the focus, and whether that shows; null for nothing.
  focus() {
    const e = document.activeElement;
    if (e === document.body) return null;
    const s = getComputedStyle(e.closest("label") ?? e);
    return [e.id || e.className || e.tagName, s.outlineStyle !== "none" && parseFloat(s.outlineWidth) >= 2];
  },
};
