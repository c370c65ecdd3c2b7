// What lies over everything: messages, keys, all commands, a lost connection.
import { signal } from '@preact/signals';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import type { App } from '../app';
import * as store from '../model/store';
import { FORMATS, KEYS, SAMPLES, SHADINGS, SHAPES, TEXT, TOOLS } from '../model/texts';
import { capital, short } from './edit';

/** What was told goes by itself after this, milliseconds; what was refused stays. */
const TOLD_MS = 4000;

export function Toasts({ app }: { app: App }) {
  const told = store.toasts.value.find((t) => t.kind === 'told');
  useEffect(() => {
    if (!told) return;
    const timer = setTimeout(() => store.dismiss(told.id), TOLD_MS);
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
                {TEXT.toast.show}
              </button>
            )}
            <button type="button" class="small" onClick={() => store.dismiss(t.id)}>
              {TEXT.toast.close}
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
  // Before the next key: who types at once types into it.
  useLayoutEffect(() => {
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
    <Dialog label={TEXT.top.keys}>
      <h2>{TEXT.top.keys}</h2>
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
        {TEXT.close}
      </button>
    </Dialog>
  );
}

export interface Command {
  name: string;
  key?: string;
  run: () => void;
}

const words = TEXT.commands;

/** All commands that do something now. */
export function commands(app: App): Command[] {
  const state = store.state.value;
  const list: Command[] = [];
  const add = (name: string, run: () => unknown, key?: string) => {
    list.push({ name, run: () => void run(), ...(key ? { key } : {}) });
  };
  if (!state.project) {
    for (const { sample } of SAMPLES) add(words[sample], () => app.sample(sample));
    for (const file of state.files) add(words.open(file), () => app.openFile(file));
    return list;
  }
  for (const tool of TOOLS) {
    if (store.canUse(tool.id, state)) add(tool.name, () => app.choose(tool.id), tool.key);
  }
  if (store.history.value[0]) add(TEXT.top.undo, app.undo, 'Ctrl Z');
  if (store.history.value[1]) add(TEXT.top.redo, app.redo, 'Ctrl Shift Z');
  if (state.layers.points && !state.layers.mesh) add(words.look, () => app.clean());
  if (state.layers.points && state.curves.length === 0) add(words.mesh, () => app.mesh());
  if (state.layers.mesh) {
    add(words.layOut, () => app.complete(24, 40));
    add(words.sharp, () => app.edit({ edit: 'feature_lines', angle_deg: 40, shortest: 0.05 }));
    add(words.boundaries, () => app.edit({ edit: 'boundaries' }));
    add(words.symmetry, () => app.edit({ edit: 'symmetry' }));
    if (state.curves.length > 0) add(words.relax, () => app.edit({ edit: 'relax' }));
  }
  const is = (name: string) => state.stages.find((s) => s.name === name)?.is;
  if (is('patches') === 'fresh') {
    add(words.fit, app.fit);
    add(words.coarse, app.fitCoarse);
  }
  if (is('surfaces') === 'fresh') {
    for (const f of FORMATS) add(words.export(f.name), () => app.export(f.format));
  }
  for (const s of Object.keys(SHAPES) as store.Shape[]) {
    if (state.layers[s]) add(words.show(SHAPES[s]), () => store.showShape(s));
  }
  for (const s of Object.keys(SHADINGS) as store.Shading[]) {
    if (!store.canShade(s, store.shape.value)) continue;
    add(words.shade(SHADINGS[s]), () => {
      store.shading.value = s;
    });
  }
  if (state.seams.length > 0) {
    add(words.angles, () => {
      store.show.value = { ...store.show.value, angles: !store.show.value.angles };
    });
  }
  if (store.hidden.value.size > 0 || store.isolated.value !== null) add(words.showAll, () => app.showAll());
  add(words.fitView, () => app.home(), 'Home');
  add(words.picture, () => app.picture());
  if (state.done.some((step) => step.counts)) add(words.script, () => app.script());
  add(
    words.keys,
    () => {
      store.overlay.value = 'keys';
    },
    '?',
  );
  add(words.away, () => app.close());
  return list;
}

const query = signal('');
const chosen = signal(0);

export function Palette({ app }: { app: App }) {
  const input = useRef<HTMLInputElement>(null);
  useLayoutEffect(() => {
    query.value = '';
    chosen.value = 0;
    input.current?.focus();
  }, []);
  const parts = query.value.toLowerCase().split(/\s+/);
  const found = commands(app).filter((c) => parts.every((w) => c.name.toLowerCase().includes(w)));
  const at = Math.min(chosen.value, found.length - 1);
  const run = (command: Command | undefined) => {
    close();
    command?.run();
  };
  return (
    <Dialog label={TEXT.palette.label}>
      <input
        ref={input}
        class="search"
        type="text"
        role="combobox"
        aria-label={TEXT.palette.command}
        aria-expanded="true"
        aria-controls="commands"
        aria-activedescendant={found.length > 0 ? `command-${at}` : undefined}
        placeholder={TEXT.palette.ask}
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
      <div class="commands" id="commands" role="listbox" aria-label={TEXT.palette.label}>
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
      {connection === 'connecting' && TEXT.connection.connecting}
      {connection === 'lost' && TEXT.connection.lost}
      {connection === 'refused' && TEXT.connection.refused}
    </div>
  );
}
