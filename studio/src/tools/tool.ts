// What a tool is: picks in, edits out. The view shows what it would do before it is done.
import type { Vector3 } from 'three';
import type { Client } from '../protocol/client';
import type { CurveName, Edit, ReliefEdit } from '../protocol/types';
import type { Found } from '../view/seek';
import type { View } from '../view/view';

/** A place of the cursor, with what lies under it. */
export interface Spot {
  x: number;
  y: number;
  /** The place of the mesh, relative to the middle. */
  place: Vector3 | null;
  corner: Found | null;
  curve: Found | null;
}

/** What tools work with. */
export interface Bench {
  view: View;
  client: Client;
  /** World position of a place of the view. */
  world(place: Vector3): [number, number, number];
  /** Makes an edit; false if it was refused, which the user is told. */
  edit(edit: Edit): Promise<boolean>;
  /** Control vertices of a curve, relative to the middle; none if it has none, which the user is told. */
  handles(curve: CurveName, control: number): Promise<Vector3[]>;
  /** Makes an edit of the relief. */
  sculpt(edit: ReliefEdit): Promise<unknown>;
  /** Leaves points out that are seen within a line. */
  lasso(view: number[], line: [number, number][]): Promise<unknown>;
  /** Shows what an edit would do; only the last one counts. */
  preview(edit: Edit | null): void;
}

export interface Tool {
  /** The cursor has moved. */
  move?(spot: Spot): void;
  /** A click. */
  click?(spot: Spot): void;
  doubleClick?(): void;
  /** The button goes down: true to have the drag, false to let it turn the view. */
  down?(spot: Spot): boolean;
  drag?(spot: Spot): void;
  up?(spot: Spot): void;
  /** A key: true if it was of use. */
  key?(key: string): boolean;
  /** Drops what is unfinished. */
  leave?(): void;
  /** Looks of the cursor. */
  cursor?: string;
}
