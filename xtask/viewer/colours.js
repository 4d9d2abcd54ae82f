// Colours that say something of a shape: numbers per vertex become three bytes each. Knows no picture.

/** Edges of the base, each once, with their lengths at rest. */
export function edges(indices, rest) {
  const seen = new Set();
  const ends = [];
  for (let t = 0; t < indices.length; t += 3) {
    for (let corner = 0; corner < 3; corner++) {
      const [a, b] = [indices[t + corner], indices[t + ((corner + 1) % 3)]].sort((a, b) => a - b);
      const key = a * 0x1000000 + b;
      if (!seen.has(key)) {
        seen.add(key);
        ends.push(a, b);
      }
    }
  }
  const lengths = new Float32Array(ends.length / 2);
  for (let e = 0; e < lengths.length; e++) lengths[e] = distance(rest, ends[2 * e], rest, ends[2 * e + 1]);
  return { ends: Uint32Array.from(ends), lengths };
}

/** How much the edges at each vertex are longer (or, below 0, shorter) than at rest: the mean of their shares. */
export function strain({ ends, lengths }, positions) {
  const [sums, counts] = [new Float32Array(positions.length / 3), new Uint16Array(positions.length / 3)];
  for (let e = 0; e < lengths.length; e++) {
    const [a, b] = [ends[2 * e], ends[2 * e + 1]];
    const share = lengths[e] > 0 ? distance(positions, a, positions, b) / lengths[e] - 1 : 0;
    sums[a] += share;
    sums[b] += share;
    counts[a]++;
    counts[b]++;
  }
  return sums.map((sum, v) => sum / Math.max(counts[v], 1));
}

/** How far each vertex lies from the same one of another shape, metres. */
export function moved(positions, others) {
  return Float32Array.from({ length: positions.length / 3 }, (_, v) => distance(positions, v, others, v));
}

/** How far two poses are from each other in these bones: the root of the summed squared angles, degrees. */
export function apart(a, b, bones) {
  let sum = 0;
  for (const bone of bones) {
    const [p, q] = [a.rotation(bone), b.rotation(bone)];
    const dot = Math.min(1, Math.abs(p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]));
    sum += ((360 / Math.PI) * Math.acos(dot)) ** 2;
  }
  return Math.sqrt(sum);
}

/** Blue below 0, grey at 0, red above; full at `full`. */
export function diverging(values, full) {
  return painted(values, (value) => {
    const share = Math.max(-1, Math.min(1, value / full));
    return share < 0 ? mix([200, 200, 200], [30, 80, 200], -share) : mix([200, 200, 200], [200, 30, 30], share);
  });
}

/** Grey at 0, yellow at the half, red at `full`. */
export function heat(values, full) {
  return painted(values, (value) => {
    const share = 2 * Math.max(0, Math.min(1, value / full));
    return share < 1 ? mix([200, 200, 200], [244, 214, 70], share) : mix([244, 214, 70], [190, 20, 20], share - 1);
  });
}

/** Directions as colours. */
export function directions(normals) {
  return Uint8Array.from(normals, (n) => Math.round(127.5 * (n + 1)));
}

function painted(values, colour) {
  const colours = new Uint8Array(3 * values.length);
  values.forEach((value, v) => colours.set(colour(value), 3 * v));
  return colours;
}

function mix(a, b, share) {
  return a.map((c, i) => Math.round(c + (b[i] - c) * share));
}

function distance(p, a, q, b) {
  return Math.hypot(p[3 * a] - q[3 * b], p[3 * a + 1] - q[3 * b + 1], p[3 * a + 2] - q[3 * b + 2]);
}
