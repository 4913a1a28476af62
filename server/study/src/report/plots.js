// What a reader does with a plot: see the values under the pointer, switch series off and on, change the axes.
// Without this script a plot is a picture. What is switched off stays off in print.
{
  const NEAR = 26;

  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  document.body.append(tip);

  /** The drawings of one plot: with other axes, but with the same series. */
  const plots = new Set([...document.querySelectorAll("svg.plot")].map((svg) => svg.closest(".axes") ?? svg));
  for (const plot of plots) {
    const drawings = plot.matches("svg") ? [plot] : [...plot.querySelectorAll("svg.plot")];
    switches(plot, drawings);
    drawings.forEach(hover);
    if (drawings.length > 1) axes(plot);
  }

  /** Names in the legend switch their series. */
  function switches(plot, drawings) {
    const off = new Set();
    const keys = drawings.flatMap((svg) => [...svg.querySelectorAll("[data-toggles]")]);
    const show = () => {
      for (const svg of drawings) {
        for (const one of svg.querySelectorAll("[data-series]")) {
          one.style.display = one.dataset.series.split(" ").some((name) => off.has(name)) ? "none" : "";
        }
      }
      for (const key of keys) key.setAttribute("aria-checked", String(!off.has(key.dataset.toggles)));
    };
    for (const key of keys) {
      const flip = () => {
        if (!off.delete(key.dataset.toggles)) off.add(key.dataset.toggles);
        show();
      };
      key.setAttribute("role", "checkbox");
      key.setAttribute("tabindex", "0");
      key.setAttribute("aria-label", key.textContent);
      key.addEventListener("click", flip);
      key.addEventListener("keydown", (event) => {
        if (event.key !== " " && event.key !== "Enter") return;
        event.preventDefault();
        flip();
      });
    }
    show();
  }

  /** A button changes between the drawings. */
  function axes(plot) {
    const drawings = [...plot.children];
    const button = document.createElement("button");
    button.type = "button";
    let shown = 0;
    const name = () => (button.textContent = `${drawings[(shown + 1) % drawings.length].dataset.axes} axes`);
    button.addEventListener("click", () => {
      shown = (shown + 1) % drawings.length;
      drawings.forEach((drawing, i) => (drawing.hidden = i !== shown));
      tip.hidden = true;
      name();
    });
    name();
    plot.append(button);
  }

  /** Shows what lies nearest to the pointer. */
  function hover(svg) {
    for (const title of svg.querySelectorAll("title")) {
      title.parentElement.dataset.tip = title.textContent;
      title.remove();
    }
    let targets;
    svg.addEventListener("pointermove", (event) => {
      targets ??= collect(svg);
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      let [best, least] = [null, NEAR];
      for (const target of targets) {
        if (target.of.style.display === "none") continue;
        const away = Math.hypot(target.x - at.x, target.y - at.y);
        if (away < least) [best, least] = [target, away];
      }
      const text = best ? best.text() : event.target.closest("[data-tip]")?.dataset.tip;
      tip.hidden = !text;
      if (!text) return;
      tip.textContent = text;
      const { width, height } = tip.getBoundingClientRect();
      tip.style.left = `${Math.max(4, Math.min(event.clientX + 14, innerWidth - width - 4))}px`;
      tip.style.top = `${event.clientY + 18 + height < innerHeight ? event.clientY + 18 : event.clientY - height - 10}px`;
    });
    svg.addEventListener("pointerleave", () => (tip.hidden = true));
  }

  /** Marks, and the corners of lines, with their places in the picture. */
  function collect(svg) {
    const marks = [...svg.querySelectorAll("g[data-tip][transform]")].map((of) => {
      const { e: x, f: y } = of.transform.baseVal.consolidate().matrix;
      return { of, x, y, text: () => of.dataset.tip };
    });
    const lines = [...svg.querySelectorAll("path[data-name]")].flatMap((of) =>
      of.getAttribute("d").slice(1).split(/[ML]/).map((corner) => {
        const [x, y] = corner.split(" ").map(Number);
        const text = () => `${of.dataset.name}\n${value(svg, "x", x)}\n${value(svg, "y", y)}`;
        return { of, x, y, text };
      }));
    return [...marks, ...lines];
  }

  /** The value at a place on an axis, with the axis' label. */
  function value(svg, axis, at) {
    const [low, high, from, to] = svg.dataset[axis].split(" ").map(Number);
    const linear = low + ((high - low) * (at - from)) / (to - from);
    const found = svg.dataset[`${axis}Power`] ? 10 ** linear : linear;
    return `${svg.dataset[`${axis}Label`]}: ${Number(found.toPrecision(4))}`;
  }
}
