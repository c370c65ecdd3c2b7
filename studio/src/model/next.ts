// The next useful step, told by the state alone.
import type { State } from '../protocol/types';

export type Next = {
  step: 'open' | 'mesh' | 'draw' | 'mend' | 'fit' | 'export' | 'wait';
  text: string;
  action: string;
};

/** What to do next, and the word on its button. */
export function next(state: State): Next {
  const { project, stages, faults, jobs } = state;
  const is = (name: string) => stages.find((s) => s.name === name)?.is ?? 'empty';
  if (!project) return { step: 'open', text: 'Drop a scan, a mesh or a project on the page.', action: '' };
  if (jobs[0]) return { step: 'wait', text: `${jobs[0].title} ...`, action: '' };
  if (is('mesh') === 'empty' || is('mesh') === 'failed') {
    return { step: 'mesh', text: 'Make a mesh of the points.', action: 'Make the mesh' };
  }
  if (is('curves') === 'empty') {
    return { step: 'draw', text: 'Paint curves on the mesh, or let patches be laid out.', action: 'Lay out patches' };
  }
  if (is('patches') !== 'fresh') {
    const left = faults.length;
    const text = left > 0 ? `${left} ${left === 1 ? 'place is' : 'places are'} no patch yet.` : 'Draw on.';
    return { step: 'mend', text, action: 'Complete the rest' };
  }
  if (is('surfaces') !== 'fresh') {
    const failed = stages.find((s) => s.name === 'surfaces' && s.is === 'failed');
    return { step: 'fit', text: failed ? failed.note : 'All of the mesh is patches.', action: 'Fit surfaces' };
  }
  return { step: 'export', text: 'Surfaces are fitted.', action: 'Export STEP' };
}
