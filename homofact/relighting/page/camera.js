// The camera: an eye that orbits a target, upright, and its projection.

class Orbit {
  constructor({ eye, target, field }) {
    const away = minus(eye, target), distance = Math.hypot(...away);
    this.start = {
      target, field, distance, azimuth: Math.atan2(away[0], away[2]) / DEGREE, elevation: Math.asin(away[1] / distance) / DEGREE,
    };
    this.first = eye;
    this.reset();
  }

  reset() {
    Object.assign(this, this.start);
  }

  /** Whether this is where the page began. */
  get atStart() {
    return ["azimuth", "elevation", "distance"].every((name) => Math.abs(this[name] - this.start[name]) < 1e-9);
  }

  get eye() {
    if (this.atStart) return this.first;
    const a = this.azimuth * DEGREE, e = this.elevation * DEGREE;
    return plus(this.target, scaled([Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)], this.distance));
  }

  turn(across, up) {
    this.azimuth = wrapped(this.azimuth + across);
    this.elevation = clamped(this.elevation + up, -89, 89);
  }

  zoom(factor) {
    this.distance = clamped(this.distance / factor, 0.25 * this.start.distance, 4 * this.start.distance);
  }

  /** Right, up and forward. */
  get axes() {
    const forward = normalized(minus(this.target, this.eye)), right = normalized(cross(forward, [0, 1, 0]));
    return [right, cross(right, forward), forward];
  }

  /** The matrix (by columns) that takes the world to the clip space of a picture of this aspect. */
  matrix(aspect, radius) {
    const eye = this.eye, [right, up, forward] = this.axes, f = 1 / Math.tan((this.field * DEGREE) / 2);
    const reach = Math.hypot(...eye), near = Math.max(reach - radius, 0.01 * reach, 1e-3), far = reach + radius;
    const rows = [scaled(right, f / aspect), scaled(up, f), scaled(forward, (far + near) / (far - near)), forward];
    const shift = rows.map((row) => -dot(row, eye));
    shift[2] -= (2 * far * near) / (far - near);
    return Float32Array.from([0, 1, 2].flatMap((c) => rows.map((row) => row[c])).concat(shift));
  }
}
