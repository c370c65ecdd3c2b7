// Icons of lines on a grid of 20.
import type { ToolId } from '../model/store';

const PATHS: Record<
  ToolId | 'undo' | 'redo' | 'sun' | 'moon' | 'help' | 'close' | 'camera' | 'command' | 'home',
  string
> = {
  select: 'M5 3l10 7-4.5 1L13 16l-2 1-2.400-5L5 15z',
  paint: 'M3 16c2-7 5-1 7-5s2-6 5-6M14 3l3 3-2 2-3-3z',
  feature: 'M4 4h12v12H4zM4 8c4 2 8-2 12 3M8 4c1 4-1 8 0 12',
  cut: 'M3 17L17 3M6 6a6 6 0 1 0 8 8',
  drag: 'M3 14c3 0 4-8 7-8s4 8 7 8M10 3v3m-2 1l2-2 2 2',
  hold: 'M3 14c4 0 5-9 14-9M10 3v5M7.500 8h5M10 8v9',
  handles: 'M4 15C7 3 13 17 16 5M4 15m-2 0a2 2 0 1 0 4 0 2 2 0 1 0-4 0M16 5m-2 0a2 2 0 1 0 4 0 2 2 0 1 0-4 0M4 13V4h3',
  lasso: 'M10 3c4 0 7 2 7 5s-3 5-7 5-7-2-7-5 3-5 7-5zM6 12c-1 2 0 3 1 3s2 1 1 3',
  carry: 'M2 6h6v8H2zM12 6h6v8h-6M7 10h6M11 8l2 2-2 2',
  corner: 'M3 15C7 15 7 5 17 5M10 10m-2.500 0a2.500 2.500 0 1 0 5 0 2.500 2.500 0 1 0-5 0',
  split: 'M10 2l7 5-2.500 9h-9L3 7zM10 10V16M10 10L3 7M10 10l7-3',
  sculpt: 'M2 15c3 0 4-2 5-5s3-5 5-1 2 6 6 6M14 2l3 3-4 4-3-3z',
  erase: 'M4 6h12M8 6V4h4v2M6 6l1 11h6l1-11M9 9v5M11 9v5',
  measure: 'M2 13L13 2l5 5L7 18zM6 9l2 2M9 6l2 2M12 3l2 2',
  undo: 'M7 4L3 8l4 4M3 8h8a5 5 0 0 1 0 10H8',
  redo: 'M13 4l4 4-4 4M17 8H9a5 5 0 0 0 0 10h3',
  sun: 'M10 6a4 4 0 1 0 0 8 4 4 0 0 0 0-8M10 1v2M10 17v2M1 10h2M17 10h2M3.600 3.600L5 5M15 15l1.400 1.400M3.600 16.400L5 15M15 5l1.400-1.400',
  moon: 'M16 12A7 7 0 0 1 8 4a7 7 0 1 0 8 8z',
  help: 'M7 7a3 3 0 1 1 4 3c-1 .5-1 1-1 2M10 15v.5',
  close: 'M5 5l10 10M15 5L5 15',
  camera: 'M2 6h4l1-2h6l1 2h4v10H2zM10 8a3 3 0 1 0 0 6 3 3 0 0 0 0-6',
  command: 'M3 5h14M3 10h14M3 15h9',
  home: 'M3 8V3h5M12 3h5v5M17 12v5h-5M8 17H3v-5M7 10h6M10 7v6',
};

export function Icon({ name }: { name: keyof typeof PATHS }) {
  return (
    <svg class="icon" viewBox="0 0 20 20" aria-hidden="true">
      <path d={PATHS[name]} />
    </svg>
  );
}
