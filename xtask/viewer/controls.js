// Sliders and lists. Knows nothing of what they move.

/** Fills a list with names; keeps what is chosen where it is still there. */
export function options(select, names, first = []) {
  const chosen = select.value;
  select.replaceChildren(...[...first, ...names.map((name) => [name, name])].map(([value, text]) => new Option(text, value)));
  if ([...select.options].some((option) => option.value === chosen)) select.value = chosen;
}

/** A slider with a number beside it; `changed(value)` is called while it moves. */
export function slider({ name, label, min, max, step, value, unit, wide }, changed) {
  const row = document.createElement("div");
  row.className = wide ? "slider wide" : "slider";
  const text = document.createElement("span");
  text.textContent = label;
  const inputs = ["range", "number"].map((type) => {
    const input = document.createElement("input");
    Object.assign(input, { type, min, max, step, value });
    input.setAttribute("aria-label", `${name}, ${unit}`);
    input.dataset.name = name;
    return input;
  });
  const set = (value, from) => inputs.filter((input) => input !== from).forEach((input) => (input.value = value));
  for (const input of inputs) {
    input.addEventListener("input", () => {
      const value = Number(input.value);
      if (input.value === "" || !Number.isFinite(value)) return;
      set(value, input);
      changed(value);
    });
  }
  row.append(text, ...inputs);
  return { row, set };
}

/** A quaternion of turns about X, then Y, then Z, degrees, as pose tables have them. */
export function quaternion([x, y, z]) {
  const [a, b, c] = [x, y, z].map((degrees) => (degrees * Math.PI) / 360);
  const times = ([ax, ay, az, aw], [bx, by, bz, bw]) => [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
  return times(times([0, 0, Math.sin(c), Math.cos(c)], [0, Math.sin(b), 0, Math.cos(b)]), [Math.sin(a), 0, 0, Math.cos(a)]);
}

/** The turns of a quaternion, degrees; the inverse of `quaternion`. */
export function turns([x, y, z, w]) {
  const sine = Math.max(-1, Math.min(1, 2 * (w * y - z * x)));
  const degrees = [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    Math.asin(sine),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  ].map((radians) => (radians * 180) / Math.PI);
  return degrees.map((angle) => Math.round(angle * 10) / 10 + 0);
}

/** Saves a file as a browser does. */
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
