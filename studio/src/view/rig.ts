// The camera as numbers: orbit, pan, zoom, fit. No DOM.
import { Matrix4, Quaternion, Vector3 } from 'three';

export type ViewName = 'front' | 'back' | 'right' | 'left' | 'top' | 'bottom' | 'corner';

/** Half the angle of view, up and down. */
export const HALF_FOV = (17 * Math.PI) / 180;
/** Half the height that can be seen, as shares of the radius of what there is. */
const LEAST_HALF = 1e-4;
const MOST_HALF = 20;
/** The eye of a turntable stays so far off the poles, radians. */
const POLE_RAD = 0.01;

type Sides = Record<ViewName, [number, number, number]>;
const UP_Z: Sides = {
  front: [0, -1, 0],
  back: [0, 1, 0],
  right: [1, 0, 0],
  left: [-1, 0, 0],
  top: [0, -POLE_RAD, 1],
  bottom: [0, -POLE_RAD, -1],
  corner: [-0.85, -0.75, 0.6],
};
const UP_Y: Sides = {
  front: [0, 0, 1],
  back: [0, 0, -1],
  right: [1, 0, 0],
  left: [-1, 0, 0],
  top: [0, 1, POLE_RAD],
  bottom: [0, -1, POLE_RAD],
  corner: [0.62, 0.42, 1],
};

export class Rig {
  target = new Vector3();
  turn = new Quaternion();
  /** Half the height of what is seen at the target. */
  half = 1;
  /** Radius of what there is. */
  radius = 1;
  up = new Vector3(0, 0, 1);

  /** Unit vector from the target to the eye. */
  toEye(): Vector3 {
    return new Vector3(0, 0, 1).applyQuaternion(this.turn);
  }

  distance(): number {
    return this.half / Math.tan(HALF_FOV);
  }

  /** Turns by shares of the height of the view. */
  orbit(dx: number, dy: number, how: 'turntable' | 'free'): void {
    const right = new Vector3(1, 0, 0).applyQuaternion(this.turn);
    const about = how === 'turntable' ? this.up : new Vector3(0, 1, 0).applyQuaternion(this.turn);
    let tilt = -dy * Math.PI;
    if (how === 'turntable') {
      const now = Math.acos(Math.max(-1, Math.min(1, this.toEye().dot(this.up))));
      tilt = Math.min(Math.PI - POLE_RAD, Math.max(POLE_RAD, now + tilt)) - now;
    }
    const along = new Quaternion().setFromAxisAngle(right, tilt);
    const across = new Quaternion().setFromAxisAngle(about, -dx * Math.PI);
    this.turn.premultiply(along).premultiply(across).normalize();
  }

  /** Moves by shares of the height of the view. */
  pan(dx: number, dy: number): void {
    const right = new Vector3(1, 0, 0).applyQuaternion(this.turn);
    const upward = new Vector3(0, 1, 0).applyQuaternion(this.turn);
    this.target.addScaledVector(right, -2 * this.half * dx).addScaledVector(upward, 2 * this.half * dy);
  }

  /** Zooms; the place under the cursor stays there. */
  zoom(factor: number, anchor?: Vector3): void {
    const half = Math.min(MOST_HALF * this.radius, Math.max(LEAST_HALF * this.radius, this.half * factor));
    if (anchor) {
      const eye = this.toEye();
      const aside = anchor.clone().sub(this.target);
      aside.addScaledVector(eye, -aside.dot(eye));
      this.target.addScaledVector(aside, 1 - half / this.half);
    }
    this.half = half;
  }

  /** Shows a ball whole. */
  fit(center: Vector3, radius: number, aspect: number): void {
    this.target.copy(center);
    this.half = (0.9 * radius) / Math.min(1, aspect);
  }

  /** Looks from a side. */
  look(name: ViewName): void {
    this.from(new Vector3(...(this.up.z === 1 ? UP_Z : UP_Y)[name]));
  }

  /** Looks from a direction. */
  from(toEye: Vector3): void {
    this.turn.setFromRotationMatrix(new Matrix4().lookAt(toEye, new Vector3(), this.up));
  }
}
