// Binary frames joined to arrays: see `crates/planish-studio/src/protocol/frame.rs`.
import type { Header, Layer } from './types';

/** A layer with its arrays by name. */
export interface Geometry {
  layer: Layer;
  name: string;
  floats: Map<string, Float32Array>;
  numbers: Map<string, Uint32Array>;
}

/** Header and payload of a frame. */
export function readFrame(frame: ArrayBuffer): { header: Header; payload: Uint8Array } {
  if (frame.byteLength < 4) throw new Error('a frame is cut off');
  const length = new DataView(frame).getUint32(0, true);
  if (4 + length > frame.byteLength) throw new Error('a frame is cut off');
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length))) as Header;
  return { header, payload: new Uint8Array(frame, 4 + length) };
}

/** Joins frames to layers. */
export class Joiner {
  private parts = new Map<Layer, { name: string; bytes: Uint8Array; got: number }>();

  /** Adds a frame; returns the layer once all of it is there. */
  add(frame: ArrayBuffer): Geometry | null {
    const { header, payload } = readFrame(frame);
    let part = this.parts.get(header.layer);
    if (!part || part.name !== header.name || header.offset === 0) {
      part = { name: header.name, bytes: new Uint8Array(header.total), got: 0 };
      this.parts.set(header.layer, part);
    }
    if (header.offset !== part.got || header.offset + payload.byteLength > part.bytes.byteLength) {
      this.parts.delete(header.layer);
      throw new Error('frames are out of order');
    }
    part.bytes.set(payload, header.offset);
    part.got += payload.byteLength;
    if (part.got < header.total) return null;
    this.parts.delete(header.layer);
    return cut(header, part.bytes);
  }
}

function cut(header: Header, bytes: Uint8Array): Geometry {
  const geometry: Geometry = { layer: header.layer, name: header.name, floats: new Map(), numbers: new Map() };
  let at = 0;
  for (const array of header.arrays) {
    const length = array.width * array.count;
    if (array.kind === 'f32') geometry.floats.set(array.name, new Float32Array(bytes.buffer, at, length));
    else geometry.numbers.set(array.name, new Uint32Array(bytes.buffer, at, length));
    at += 4 * length;
  }
  return geometry;
}
