// The plots and orbits of the chosen group: which are there, what they show, when they are drawn.

import { ALL, colours, groupsOf, panelsOf, plotOf } from "./plots.js";

const $ = (id) => document.getElementById(id);

function tabOf(group, choose) {
  const tab = document.createElement("button");
  tab.type = "button";
  tab.textContent = group;
  tab.setAttribute("role", "tab");
  tab.setAttribute("aria-controls", "plots");
  tab.addEventListener("click", () => choose(group));
  return tab;
}

function arrowsMove(list, choose) {
  list.addEventListener("keydown", (event) => {
    const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const tabs = [...list.children];
    const at = tabs.indexOf(document.activeElement);
    if (!way || at < 0) return;
    const next = tabs[(at + way + tabs.length) % tabs.length];
    next.focus();
    choose(next.textContent);
  });
}

/** The group that is chosen, drawn when samples came; `hold` keeps a moment. */
export function picturesView(orbitOf) {
  const now = { history: null, panels: [], plots: [], orbits: [], group: "", last: {}, held: null, asked: false, lost: 0 };
  let palette = colours();
  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const plot = now.plots.find((p) => p.node === target);
      if (plot) plot.visible = isIntersecting;
    }
    ask();
  }, { rootMargin: "100px" });

  const draw = () => {
    now.asked = false;
    if (!now.history) return;
    const seconds = Number($("window").value);
    const end = now.held ?? now.history.last;
    if (Number.isFinite(end)) for (const plot of now.plots) if (plot.visible) plot.show(now.history, seconds, end, now.last);
    $("lost").textContent = now.lost ? `${now.lost.toLocaleString("en")} samples are not shown here; the recording has them all.` : "";
    for (const done of now.after?.splice(0) ?? []) done();
  };
  const ask = () => {
    if (!now.asked) requestAnimationFrame(draw);
    now.asked = true;
  };

  const choose = (group) => {
    now.group = group;
    for (const tab of $("tabs").children) {
      const chosen = tab.textContent === group;
      tab.setAttribute("aria-selected", chosen);
      tab.tabIndex = chosen ? 0 : -1;
    }
    for (const plot of now.plots) plot.remove();
    seen.disconnect();
    now.plots = now.panels.filter((p) => group === ALL || p.group === group).map((panel) => plotOf(panel, () => palette));
    $("plots").replaceChildren(...now.plots.map((p) => p.node));
    for (const plot of now.plots) seen.observe(plot.node);
    ask();
  };

  arrowsMove($("tabs"), choose);
  $("window").addEventListener("change", ask);
  $("hold").addEventListener("click", () => {
    now.held = now.held === null && now.history ? now.history.last : null;
    $("hold").setAttribute("aria-pressed", now.held !== null);
    $("hold").textContent = now.held === null ? "Hold" : "Held: go on";
    document.body.classList.toggle("held", now.held !== null);
    ask();
  });
  const redrawOrbits = () => { for (const orbit of now.orbits) orbit.view.redraw($("zoom").checked); };
  $("zoom").addEventListener("change", redrawOrbits);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    palette = colours();
    for (const plot of now.plots) plot.redraw();
    redrawOrbits();
  });
  new ResizeObserver(() => { ask(); redrawOrbits(); }).observe($("pictures"));

  return {
    /** A run begins: its channels and orbits. */
    begin(hello, history) {
      Object.assign(now, { history, panels: panelsOf(hello.channels), last: {}, held: null, lost: 0, after: [] });
      now.orbits = (hello.orbits || []).map((orbit) => ({ name: orbit.name, view: orbitOf({ zones: [], ...orbit }, () => palette) }));
      $("orbits").replaceChildren(...now.orbits.map((o) => o.view.node));
      $("round").hidden = !now.orbits.length;
      redrawOrbits();
      const groups = groupsOf(now.panels);
      $("tabs").replaceChildren(...groups.map((group) => tabOf(group, choose)));
      $("tabs").hidden = groups.length < 2;
      choose(groups[0] || ALL);
    },
    /** A block of samples. */
    take(block, float32) {
      now.history.append(block);
      for (const [name, { last }] of Object.entries(block.channels)) now.last[name] = last;
      if (now.held !== null) return;
      for (const { name, view } of now.orbits) {
        const orbit = block.orbits?.[name];
        if (orbit) view.show(float32(orbit.x), float32(orbit.y), $("zoom").checked);
      }
    },
    /** Draws with the next frame of the screen, then calls `done`. */
    draw(lost, done) {
      now.lost = lost;
      now.after.push(done);
      ask();
    },
    newestTime: () => now.history?.last ?? NaN,
  };
}
