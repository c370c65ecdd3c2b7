// What panels and view make of numbers; and that all words are in one file.
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { BRUSH, brush, brushLength, canUse, EMPTY, history, setBrush, state, tool } from '../../src/model/store';
import { TOOLS } from '../../src/model/texts';
import { tint } from '../../src/panels/relief';
import type { Geometry } from '../../src/protocol/frames';
import type { State } from '../../src/protocol/types';
import { strokeOf } from '../../src/tools/sculpt';
import { blend } from '../../src/view/blend';
import { colorsOf, tints, usualRange } from '../../src/view/cloud';
import { placeAt, stretch } from '../../src/view/lines';

const layer = (floats: Record<string, number[]>): Geometry => ({
  layer: 'points',
  name: 'a',
  floats: new Map(Object.entries(floats).map(([k, v]) => [k, new Float32Array(v)])),
  numbers: new Map(),
});

describe('a stretch of a curve', () => {
  const lines = {
    position: new Float32Array([0, 0, 0, 1, 0, 0, 1, 1, 0, 1, 3, 0]),
    offset: new Uint32Array([0, 4]),
  };
  it('runs from share to share of its length, whichever comes first', () => {
    expect([...stretch(lines, 0, 0.125, 0.5)]).toEqual([0.5, 0, 0, 1, 0, 0, 1, 0, 0, 1, 1, 0]);
    expect(stretch(lines, 0, 0.5, 0.125)).toEqual(stretch(lines, 0, 0.125, 0.5));
  });
  it('has its pins at their shares, the first and the last at the ends', () => {
    expect(placeAt(lines, 0, 0)).toEqual([0, 0, 0]);
    expect(placeAt(lines, 0, 0.75)).toEqual([1, 2, 0]);
    expect(placeAt(lines, 0, 1)).toEqual([1, 3, 0]);
  });
});

describe('points of a scan', () => {
  const cloud = layer({
    position: [0, 0, 0, 0, 0, 1, 0, 0, 2],
    outlier: [0, 1, 0],
    normal: [0, 0, 1, 1, 0, 0, 0, 1, 0],
  });
  it('can be coloured by what is known of them', () => {
    expect(colorsOf(cloud)).toEqual(['height', 'normal', 'outlier']);
    expect(colorsOf(undefined)).toEqual(['height']);
  });
  it('are redder where they are outliers, and differ in height', () => {
    const outliers = tints(cloud, 'outlier', 2);
    expect(outliers[3]! - outliers[4]!).toBeGreaterThan(0.5);
    expect(Math.abs(outliers[0]! - outliers[1]!)).toBeLessThan(0.1);
    const height = tints(cloud, 'height', 2);
    expect(height[6]!).toBeGreaterThan(height[0]!);
  });
  it('keep the scale of most of them where one is far off', () => {
    const values = new Float32Array(1000).map((_, k) => k / 1000);
    values[500] = 1e9;
    expect(usualRange(values)[1]).toBeLessThan(1.01);
  });
});

describe('relief', () => {
  it('at strength 0 is the surface, at 2 twice as far, and of another fit what was sent', () => {
    const [smooth, rough] = [
      layer({ position: [0, 0, 0], normal: [0, 0, 1] }),
      layer({ position: [0, 0, 3], normal: [1, 0, 1] }),
    ];
    expect([...blend(smooth, rough, 0).floats.get('position')!]).toEqual([0, 0, 0]);
    expect([...blend(smooth, rough, 2).floats.get('position')!]).toEqual([0, 0, 6]);
    expect([...blend(smooth, rough, 2).floats.get('normal')!]).toEqual([2, 0, 1]);
    expect(blend(undefined, rough, 2)).toBe(rough);
    expect(blend(layer({ position: [0, 0, 0, 1, 1, 1], normal: [] }), rough, 2)).toBe(rough);
  });
  it('is blue below and red above', () => {
    const [low, high] = [tint(-1), tint(1)];
    expect(low[2]).toBeGreaterThan(low[0]);
    expect(high[0]).toBeGreaterThan(high[2]);
  });
});

describe('the brush', () => {
  const path: [number, number, number][] = [
    [0, 0, 1],
    [0, 1, 1],
  ];
  it('raises and engraves by its height, and smooths and erases along its way', () => {
    expect(strokeOf('raise', path, 2, 0.5)).toEqual({ edit: 'stroke', path, radius: 2, height: 0.5 });
    expect(strokeOf('engrave', path, 2, 0.5)).toMatchObject({ edit: 'stroke', height: -0.5 });
    const region = { path, radius: 2, feather: 2 };
    expect(strokeOf('erase', path, 2, 0.5)).toEqual({ edit: 'erase', region });
    expect(strokeOf('smooth', path, 2, 0.5)).toMatchObject({ edit: 'blur', region });
  });
  it('has lengths of the diagonal in steps of a quarter, between its ends', () => {
    setBrush('radius', 1);
    expect(brushLength('radius')).toBeCloseTo(0.05, 12);
    setBrush('radius', 99);
    expect(brush.value.radius).toBe(BRUSH.radius.most);
    setBrush('radius', 0);
  });
  it('in hand has Undo for itself', () => {
    state.value = { ...EMPTY, done: [{ edit: 'mesh' }], relief_undone: ['stroke'] };
    expect(history.value).toEqual([1, 0]);
    tool.value = 'sculpt';
    expect(history.value).toEqual([0, 1]);
    tool.value = 'select';
    state.value = EMPTY;
  });
});

describe('tools', () => {
  const having = (some: Partial<State>): State => ({ ...EMPTY, ...some });
  it('have keys of their own, and are offered where they have something to work on', () => {
    expect(new Set(TOOLS.map((t) => t.key)).size).toBe(TOOLS.length);
    const offered = (s: State) => TOOLS.filter((t) => canUse(t.id, s)).map((t) => t.id);
    expect(offered(having({ layers: { points: 'p' } }))).toEqual(['select', 'lasso']);
    const meshed = offered(having({ layers: { mesh: 'm' } }));
    expect(meshed).toContain('paint');
    for (const id of ['handles', 'hold', 'feature', 'lasso', 'carry']) expect(meshed).not.toContain(id);
    expect(offered(having({ layers: { mesh: 'm' }, files: ['a.planish'] }))).toContain('carry');
  });
});

describe('words of the page', () => {
  const root = join(import.meta.dirname, '../../src');
  const files = ['panels', 'tools'].flatMap((f) => readdirSync(join(root, f)).map((name) => join(root, f, name)));
  it.each([...files, join(root, 'main.tsx')])('are all in texts.ts: %s', (path) => {
    const code = readFileSync(path, 'utf8').replace(/\/\*[\s\S]*?\*\/|\/\/.*$/gm, '');
    // A text between tags, a label that is written out, a sentence in quotes.
    const found = [
      ...code.matchAll(/^\s+([A-Z][a-z]+( [a-z]+)*)$/gm),
      ...code.matchAll(/<(?:\w+)[^<>]*[^=]>([A-Z][^<>{}]*)</g),
      ...code.matchAll(/(?:label|title|aria-label|data-tip|placeholder)="([^"]+)"/g),
      ...code.matchAll(/['"`]([A-Z][a-z]+ [a-z][^'"`]*)['"`]/g),
    ].map((m) => m[1]);
    expect(found).toEqual([]);
  });
});
