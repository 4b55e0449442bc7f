"use strict";
// The camera: from points in metres to pixels. In the plane it shifts and zooms, in space it turns as well.
class Camera {
  constructor(dimension) {
    this.dimension = dimension;
    this.reset();
  }

  reset() {
    this.azimuth = -60 * Math.PI / 180;
    this.elevation = 25 * Math.PI / 180;
    this.zoom = 1;
    this.shift = [0, 0];
  }

  // Rows of the projection: what is to the right, and what is up.
  get rows() {
    if (this.dimension === 2) return [[1, 0], [0, 1]];
    const [c, s] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    return [[-s, c, 0], [-se * c, -se * s, ce]];
  }

  // half: metres from the centre to the nearer edge at zoom 1.
  place(centre, half, width, height) {
    this.centre = centre;
    this.scale = this.zoom * Math.min(width, height) / (2 * half);
    this.origin = [width / 2 + this.shift[0], height / 2 + this.shift[1]];
    this.projection = this.rows;
  }

  project(point) {
    let right = 0, up = 0;
    for (let i = 0; i < this.dimension; i++) {
      const away = point[i] - this.centre[i];
      right += this.projection[0][i] * away;
      up += this.projection[1][i] * away;
    }
    return [this.origin[0] + this.scale * right, this.origin[1] - this.scale * up];
  }

  direction(vector) {
    const along = (row) => row.reduce((sum, value, i) => sum + value * vector[i], 0);
    return [along(this.projection[0]), -along(this.projection[1])];
  }

  // Half axes in pixels and angle of the shadow of an ellipsoid with covariance S.
  ellipse(S, radius) {
    const [u, v] = this.projection;
    const form = (a, b) => {
      let sum = 0;
      for (let i = 0; i < this.dimension; i++) for (let j = 0; j < this.dimension; j++) sum += a[i] * S[i][j] * b[j];
      return sum;
    };
    const [p, q, r] = [form(u, u), form(u, v), form(v, v)];
    const middle = (p + r) / 2, spread = Math.hypot((p - r) / 2, q);
    const size = (value) => radius * this.scale * Math.sqrt(Math.max(0, value));
    return [size(middle + spread), size(middle - spread), -0.5 * Math.atan2(2 * q, p - r)];
  }
}

// Steps of 1, 2 or 5 times a power of ten, about so many in the range.
function niceStep(range, count) {
  const raw = range / Math.max(1, count);
  const power = Math.pow(10, Math.floor(Math.log10(raw)));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999);
}

function ticks(low, high, count) {
  const step = niceStep(high - low, count), found = [];
  for (let i = Math.ceil(low / step); i * step <= high; i++) found.push(i * step);
  return [found, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
}
