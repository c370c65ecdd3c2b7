// The next useful step, told by the state alone.
import type { State } from '../protocol/types';
import { TEXT } from './texts';

export type Next = {
  step: 'open' | 'mesh' | 'draw' | 'mend' | 'fit' | 'export' | 'wait';
  text: string;
  action: string;
};

/** What to do next, and the word on its button. */
export function next(state: State): Next {
  const { project, stages, faults, jobs } = state;
  const words = TEXT.next;
  const is = (name: string) => stages.find((s) => s.name === name)?.is ?? 'empty';
  if (!project) return { step: 'open', text: words.open, action: '' };
  if (jobs[0]) return { step: 'wait', text: words.wait(jobs[0].title), action: '' };
  if (is('mesh') === 'empty' || is('mesh') === 'failed') {
    return { step: 'mesh', text: words.mesh, action: words.meshDo };
  }
  if (is('curves') === 'empty') return { step: 'draw', text: words.draw, action: words.drawDo };
  if (is('patches') !== 'fresh') {
    return { step: 'mend', text: faults.length > 0 ? words.left(faults.length) : words.on, action: words.mendDo };
  }
  if (is('surfaces') !== 'fresh') {
    const failed = stages.find((s) => s.name === 'surfaces' && s.is === 'failed');
    const text = is('surfaces') === 'partial' ? words.coarse : words.fit;
    return { step: 'fit', text: failed ? failed.note : text, action: words.fitDo };
  }
  return { step: 'export', text: words.export, action: words.exportDo };
}
