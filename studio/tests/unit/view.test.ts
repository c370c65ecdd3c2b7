// The camera and what is drawn, as numbers.
import { Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { count, digits, plural } from '../../src/model/format';
import { pieces, same, share, Thick } from '../../src/view/lines';
import { Rig } from '../../src/view/rig';

describe('the camera', () => {
  it('looks from the sides that it is told, with up upward', () => {
    const rig = new Rig();
    rig.look('front');
    expect(rig.toEye().distanceTo(new Vector3(0, -1, 0))).toBeLessThan(1e-9);
    rig.up.set(0, 1, 0);
    rig.look('front');
    expect(rig.toEye().distanceTo(new Vector3(0, 0, 1))).toBeLessThan(1e-9);
  });

  it('never tips over on a turntable, and does so when it turns freely', () => {
    const rig = new Rig();
    rig.look('front');
    for (let k = 0; k < 100; k++) rig.orbit(0, -0.1, 'turntable');
    const upward = new Vector3(0, 1, 0).applyQuaternion(rig.turn);
    expect(upward.z).toBeGreaterThan(0);
    expect(Math.abs(rig.toEye().z)).toBeCloseTo(1, 3);
    rig.look('front');
    for (let k = 0; k < 10; k++) rig.orbit(0, -0.1, 'free');
    expect(new Vector3(0, 1, 0).applyQuaternion(rig.turn).z).toBeLessThan(0);
  });

  it('comes back after a whole turn', () => {
    const rig = new Rig();
    rig.look('corner');
    const before = rig.toEye();
    for (let k = 0; k < 20; k++) rig.orbit(0.1, 0, 'turntable');
    expect(rig.toEye().distanceTo(before)).toBeLessThan(1e-9);
  });

  it('keeps the place under the cursor where it is while it zooms', () => {
    const rig = new Rig();
    rig.look('corner');
    rig.radius = 1;
    const anchor = new Vector3(0.3, -0.2, 0.4);
    const across = () => {
      const right = new Vector3(1, 0, 0).applyQuaternion(rig.turn);
      return anchor.clone().sub(rig.target).dot(right) / rig.half;
    };
    const before = across();
    rig.zoom(0.5, anchor);
    expect(across()).toBeCloseTo(before, 9);
    for (let k = 0; k < 200; k++) rig.zoom(0.5);
    expect(rig.half).toBeGreaterThan(0);
    for (let k = 0; k < 200; k++) rig.zoom(2);
    expect(rig.half).toBeLessThanOrEqual(20);
  });

  it('pans by the height of the view', () => {
    const rig = new Rig();
    rig.look('front');
    rig.half = 2;
    rig.pan(0.5, 0);
    expect(rig.target.x).toBeCloseTo(-2, 9);
  });
});

describe('lines', () => {
  const courses = {
    position: new Float32Array([0, 0, 0, 1, 0, 0, 1, 3, 0, 5, 5, 5, 6, 5, 5]),
    offset: new Uint32Array([0, 3, 5]),
  };

  it('are cut into pieces per curve', () => {
    expect([...pieces(courses, [1])]).toEqual([5, 5, 5, 6, 5, 5]);
    expect(pieces(courses, [0, 1]).length).toBe(18);
  });

  it('that are shown already are told from new ones', () => {
    const line = new Thick('#000000', 2);
    expect(line.set(new Float32Array())).toBe(false);
    expect(line.set(new Float32Array([0, 0, 0, 1, 0, 0]))).toBe(true);
    expect(line.set(new Float32Array([0, 0, 0, 1, 0, 0]))).toBe(false);
    expect(line.set(new Float32Array([0, 0, 0, 1, 0, 0]), new Float32Array(6))).toBe(true);
    expect(line.set(new Float32Array())).toBe(true);
    expect([same(undefined, undefined), same(undefined, new Float32Array())]).toEqual([true, false]);
  });

  it('know the share of their length at a place', () => {
    expect(share(courses, 0, 0, 0)).toBe(0);
    expect(share(courses, 0, 1, 0)).toBe(0.25);
    expect(share(courses, 0, 1, 1)).toBe(1);
    expect(share(courses, 1, 3, 0.5)).toBe(0.5);
  });
});

describe('numbers', () => {
  it('have three digits that tell something', () => {
    expect([0, 0.000012, 0.01234, 1.5, 123456.7].map(digits)).toEqual(['0', '1.2e-5', '0.0123', '1.5', '123000']);
    expect([1, 999, 1234567].map(count)).toEqual(['1', '999', '1\u202f234\u202f567']);
    expect([plural(1, 'patch', 'patches'), plural(2, 'patch', 'patches')]).toEqual(['1 patch', '2 patches']);
  });
});
