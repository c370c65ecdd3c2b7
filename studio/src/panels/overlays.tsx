// What lies over everything: messages, keys, all commands, a lost connection.
import { signal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import type { App } from '../app';
import * as store from '../model/store';
import { FORMATS, KEYS, SHADINGS, SHAPES, TOOLS } from '../model/texts';
import { capital, short } from './edit';

/** What was told goes by itself after this, milliseconds; what was refused stays. */
const TOLD = 4000;

export function Toasts({ app }: { app: App }) {
  const told = store.toasts.value.find((t) => t.kind === 'told');
  useEffect(() => {
    if (!told) return;
    const timer = setTimeout(() => store.dismiss(told.id), TOLD);
    return () => clearTimeout(timer);
  }, [told?.id]);
  return (
    <div class="toasts" aria-live="polite">
      {store.toasts.value.map((t) => (
        <div key={t.id} class={`toast ${t.kind}`}>
          <p>{capital(short(t.why.message))}</p>
          {t.why.hint && <p class="faint">{capital(t.why.hint)}</p>}
          <div class="row">
            {t.why.place && (
              <button type="button" class="small" onClick={() => app.fly(t.why.place!)}>
                Show
              </button>
            )}
            <button type="button" class="small" onClick={() => store.dismiss(t.id)}>
              Close
            </button>
          </div>
        </div>
      ))}
    </div>
  );
}

function close(): void {
  store.overlay.value = 'none';
}

function Dialog({ label, children }: { label: string; children: preact.ComponentChildren }) {
  const dialog = useRef<HTMLDialogElement>(null);
  // One that has gone tells that it was closed when another one may be open already.
  const gone = useRef(false);
  useEffect(() => {
    const shown = dialog.current;
    shown?.showModal();
    return () => {
      gone.current = true;
      shown?.close();
    };
  }, []);
  return (
    <dialog
      ref={dialog}
      aria-label={label}
      onClose={() => gone.current || close()}
      onClick={(e) => e.target === dialog.current && close()}
      onKeyDown={(e) => e.key === 'Escape' && close()}
    >
      {children}
    </dialog>
  );
}

export function Keys() {
  return (
    <Dialog label="Keys">
      <h2>Keys</h2>
      <dl class="keys">
        {KEYS.map((k) => (
          <div key={k.keys}>
            <dt>
              <kbd>{k.keys}</kbd>
            </dt>
            <dd>{k.what}</dd>
          </div>
        ))}
      </dl>
      <button type="button" class="primary" onClick={close}>
        Close
      </button>
    </Dialog>
  );
}

export interface Command {
  name: string;
  key?: string;
  run: () => void;
}

/** All commands that do something now. */
export function commands(app: App): Command[] {
  const state = store.state.value;
  const list: Command[] = [];
  const add = (name: string, run: () => unknown, key?: string) => {
    list.push({ name, run: () => void run(), ...(key ? { key } : {}) });
  };
  if (!state.project) {
    add('Open the demonstration part', () => app.sample('part'));
    add('Open a noisy scan', () => app.sample('scan'));
    add('Open the bracket', () => app.sample('bracket'));
    for (const file of state.files) add(`Open ${file}`, () => app.openFile(file));
    return list;
  }
  for (const tool of TOOLS) {
    if (!state.layers.mesh || (tool.id === 'feature' && state.patches.length === 0)) continue;
    add(tool.name, () => app.choose(tool.id), tool.key);
  }
  if (state.done.length > 0) add('Undo', app.undo, 'Ctrl Z');
  if (state.undone.length > 0) add('Redo', app.redo, 'Ctrl Shift Z');
  if (state.layers.points && state.curves.length === 0) add('Make a mesh of the scan', () => app.mesh());
  if (state.layers.mesh) {
    add('Lay out patches', () => app.complete(24, 40));
    add('Draw sharp edges', () => app.edit({ edit: 'feature_lines', angle_deg: 40, shortest: 0.05 }));
    add('Draw boundaries', () => app.edit({ edit: 'boundaries' }));
    add('Find symmetry', () => app.edit({ edit: 'symmetry' }));
    if (state.curves.length > 0) add('Relax all curves', () => app.edit({ edit: 'relax' }));
  }
  const is = (name: string) => state.stages.find((s) => s.name === name)?.is;
  if (is('patches') === 'fresh') add('Fit surfaces', app.fit);
  if (is('surfaces') === 'fresh') {
    for (const f of FORMATS) add(`Export ${f.name}`, () => app.export(f.format));
  }
  for (const s of Object.keys(SHAPES) as store.Shape[]) {
    if (state.layers[s]) add(`Show ${SHAPES[s].toLowerCase()}`, () => store.showShape(s));
  }
  for (const s of Object.keys(SHADINGS) as store.Shading[]) {
    if (!store.canShade(s, store.shape.value)) continue;
    add(`Shade: ${SHADINGS[s].toLowerCase()}`, () => {
      store.shading.value = s;
    });
  }
  add('Fit the view', () => app.home(), 'Home');
  add('Save a picture', () => app.picture());
  if (state.done.length > 0) add('Save the edits as a script', () => app.script());
  add(
    'Keys',
    () => {
      store.overlay.value = 'keys';
    },
    '?',
  );
  add('Put the project away', () => app.close());
  return list;
}

const query = signal('');
const chosen = signal(0);

export function Palette({ app }: { app: App }) {
  const input = useRef<HTMLInputElement>(null);
  useEffect(() => {
    query.value = '';
    chosen.value = 0;
    input.current?.focus();
  }, []);
  const words = query.value.toLowerCase().split(/\s+/);
  const found = commands(app).filter((c) => words.every((w) => c.name.toLowerCase().includes(w)));
  const at = Math.min(chosen.value, found.length - 1);
  const run = (command: Command | undefined) => {
    close();
    command?.run();
  };
  return (
    <Dialog label="All commands">
      <input
        ref={input}
        class="search"
        type="text"
        role="combobox"
        aria-label="Command"
        aria-expanded="true"
        aria-controls="commands"
        aria-activedescendant={found.length > 0 ? `command-${at}` : undefined}
        placeholder="What is to be done?"
        value={query.value}
        onInput={(e) => {
          query.value = e.currentTarget.value;
          chosen.value = 0;
        }}
        onKeyDown={(e) => {
          if (e.key === 'ArrowDown') chosen.value = Math.min(at + 1, found.length - 1);
          else if (e.key === 'ArrowUp') chosen.value = Math.max(at - 1, 0);
          else if (e.key === 'Enter') run(found[at]);
          else return;
          e.preventDefault();
        }}
      />
      <div class="commands" id="commands" role="listbox" aria-label="Commands">
        {found.map((c, k) => (
          // biome-ignore lint/a11y/useFocusableInteractive: the field keeps the focus and names the chosen one
          // biome-ignore lint/a11y/useKeyWithClickEvents: keys go to the field
          <div
            key={c.name}
            id={`command-${k}`}
            role="option"
            aria-selected={k === at}
            class={k === at ? 'command on' : 'command'}
            onClick={() => run(c)}
          >
            {c.name}
            {c.key && <kbd>{c.key}</kbd>}
          </div>
        ))}
      </div>
    </Dialog>
  );
}

export function Connection() {
  const connection = store.connection.value;
  if (connection === 'open') return null;
  return (
    <div class="connection" role="alert">
      {connection === 'connecting' && 'Connecting ...'}
      {connection === 'lost' && 'The connection is lost. It comes back by itself once planish runs again.'}
      {connection === 'refused' &&
        'planish does not let this page in: open the address that it printed, with all of its letters.'}
    </div>
  );
}
