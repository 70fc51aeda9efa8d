// A smooth surface through scattered points, for display between a dozen channels.

// Thin-plate spline (Duchon 1977): w = a + b x + c y + sum_i d_i r_i^2 ln r_i, the smoothest surface near the values;
// `smoothing` allows deviations if neighbours disagree. Points about in the unit square. @returns (x, y) -> w, or null
// if the points are on a line.
function plateThrough(points, values, smoothing = 0.01) {
  const n = points.length;
  const kernel = (dx, dy) => {
    const square = dx * dx + dy * dy;
    return square > 0 ? 0.5 * square * Math.log(square) : 0;
  };
  const rows = points.map(([x, y], i) => [...points.map(([u, v], j) => kernel(x - u, y - v) + (i === j ? smoothing : 0)), 1, x, y, values[i]]);
  for (const part of [() => 1, ([x]) => x, ([, y]) => y]) rows.push([...points.map(part), 0, 0, 0, 0]);
  const d = solveDense(rows);
  if (!d) return null;
  return (x, y) => {
    let w = d[n] + d[n + 1] * x + d[n + 2] * y;
    for (let i = 0; i < n; ++i) w += d[i] * kernel(x - points[i][0], y - points[i][1]);
    return w;
  };
}

// Gaussian elimination with column pivoting; rows are [A | b]. @returns x, null if singular.
function solveDense(rows) {
  const n = rows.length;
  for (let k = 0; k < n; ++k) {
    let best = k;
    for (let i = k + 1; i < n; ++i) if (Math.abs(rows[i][k]) > Math.abs(rows[best][k])) best = i;
    if (Math.abs(rows[best][k]) < 1e-10) return null;
    [rows[k], rows[best]] = [rows[best], rows[k]];
    for (let i = k + 1; i < n; ++i) {
      const factor = rows[i][k] / rows[k][k];
      for (let j = k; j <= n; ++j) rows[i][j] -= factor * rows[k][j];
    }
  }
  const x = new Array(n).fill(0);
  for (let i = n - 1; i >= 0; --i) {
    let sum = rows[i][n];
    for (let j = i + 1; j < n; ++j) sum -= rows[i][j] * x[j];
    x[i] = sum / rows[i][i];
  }
  return x;
}
