// The golden messages, which the server's tests read too.
import { readFileSync } from 'node:fs';
import { beforeEach, describe, expect, it } from 'vitest';
import { next } from '../../src/model/next';
import * as store from '../../src/model/store';
import { Joiner, readFrame } from '../../src/protocol/frames';
import type { Message, State } from '../../src/protocol/types';

const golden = (name: string) =>
  JSON.parse(readFileSync(new URL(`../../../protocol/${name}`, import.meta.url), 'utf8'));

function stateOf(): State {
  const { type: _, ...state } = (golden('messages.json') as Message[]).find((m) => m.type === 'state')! as Extract<
    Message,
    { type: 'state' }
  >;
  return state;
}

function frame(header: object, payload: Uint8Array): ArrayBuffer {
  let text = new TextEncoder().encode(JSON.stringify(header));
  const padded = new Uint8Array(Math.ceil(text.length / 4) * 4).fill(32);
  padded.set(text);
  text = padded;
  const all = new Uint8Array(4 + text.length + payload.length);
  new DataView(all.buffer).setUint32(0, text.length, true);
  all.set(text, 4);
  all.set(payload, 4 + text.length);
  return all.buffer;
}

describe('golden messages', () => {
  it('has one of every kind that the page takes', () => {
    const kinds = new Set((golden('messages.json') as Message[]).map((m) => m.type));
    expect([...kinds].sort()).toEqual([
      'done',
      'exported',
      'handles',
      'map',
      'progress',
      'refused',
      'script',
      'state',
      'tried',
      'tried_patch',
      'welcome',
    ]);
  });

  it('gives a state that the page offers to mend', () => {
    const state = stateOf();
    expect(next(state)).toMatchObject({ step: 'mend', action: 'Complete the rest' });
    store.takeState(state);
    expect(store.wanted.value).toEqual(['mesh', 'curves']);
  });
});

describe('frames', () => {
  const values = new Float32Array([1, 2, 3, 4, 5, 6]);
  const index = new Uint32Array([0, 1, 1]);
  const bytes = new Uint8Array([...new Uint8Array(values.buffer), ...new Uint8Array(index.buffer)]);
  const arrays = [
    { name: 'position', kind: 'f32', width: 3, count: 2 },
    { name: 'index', kind: 'u32', width: 1, count: 3 },
  ];
  const header = (offset: number) => ({ layer: 'mesh', name: 'm', offset, total: bytes.length, arrays });

  it('join to arrays, whatever comes between', () => {
    const joiner = new Joiner();
    expect(joiner.add(frame(header(0), bytes.slice(0, 16)))).toBeNull();
    const other = { layer: 'nets', name: 'n', offset: 0, total: 0, arrays: [] };
    expect(joiner.add(frame(other, new Uint8Array()))?.layer).toBe('nets');
    const whole = joiner.add(frame(header(16), bytes.slice(16)));
    expect([...whole!.floats.get('position')!]).toEqual([...values]);
    expect([...whole!.numbers.get('index')!]).toEqual([...index]);
  });

  it('that are cut off or out of order are refused', () => {
    expect(() => readFrame(new ArrayBuffer(2))).toThrow('cut off');
    expect(() => readFrame(new Uint8Array([255, 0, 0, 0, 1]).buffer)).toThrow('cut off');
    expect(() => new Joiner().add(frame(header(16), bytes.slice(16)))).toThrow('out of order');
  });
});

describe('the state of the page', () => {
  beforeEach(() => {
    store.takeState(store.EMPTY);
    store.selected.value = null;
  });

  it('keeps what is selected while it is there, and drops it when numbers change', () => {
    const state = stateOf();
    store.takeState(state);
    store.selected.value = { kind: 'curve', index: 0 };
    store.takeState({ ...state, revision: 4 });
    expect(store.selected.value).toEqual({ kind: 'curve', index: 0 });
    store.takeState({ ...state, curves: [...state.curves, ...state.curves] });
    expect(store.selected.value).toBeNull();
  });

  it('shows the points until there is a mesh, and surfaces only while there are some', () => {
    const state = stateOf();
    store.takeState({ ...state, layers: { points: 'p' } });
    expect(store.shape.value).toBe('points');
    store.takeState({ ...state, layers: { points: 'p', mesh: 'm', surfaces: 's' } });
    expect(store.shape.value).toBe('mesh');
    store.showShape('surfaces');
    store.shading.value = 'deviation';
    store.takeState({ ...state, layers: { mesh: 'm' } });
    expect([store.shape.value, store.shading.value]).toEqual(['mesh', 'clay']);
  });

  it('asks for geometry once by its name, and again when the name changes', () => {
    const state = stateOf();
    store.takeState(state);
    const asked = new Map(store.missing(new Map()).map((l) => [l, state.layers[l]!]));
    expect(store.missing(asked)).toEqual([]);
    store.takeState({ ...state, layers: { ...state.layers, curves: 'curves-1-4' } });
    expect(store.missing(asked)).toEqual(['curves']);
  });

  it('offers each step in its turn', () => {
    const state = stateOf();
    const at = (is: Record<string, string>, more: object = {}) =>
      next({ ...state, ...more, stages: state.stages.map((s) => ({ ...s, is: is[s.name] ?? s.is })) } as State).step;
    expect(next(store.EMPTY).step).toBe('open');
    expect(at({ mesh: 'empty' })).toBe('mesh');
    expect(at({ curves: 'empty' })).toBe('draw');
    expect(at({ patches: 'partial' })).toBe('mend');
    expect(at({ patches: 'fresh', surfaces: 'stale' })).toBe('fit');
    expect(at({ patches: 'fresh', surfaces: 'failed' })).toBe('fit');
    expect(at({ patches: 'fresh', surfaces: 'fresh' })).toBe('export');
    const jobs = [{ job: 1, title: 'Fitting surfaces', stage: '', fraction: 0, can_stop: true }];
    expect(at({}, { jobs })).toBe('wait');
  });

  it('shows the same message once', () => {
    store.toasts.value = [];
    store.toast('refused', { message: 'a' });
    store.toast('refused', { message: 'a' });
    expect(store.toasts.value.length).toBe(1);
  });
});
