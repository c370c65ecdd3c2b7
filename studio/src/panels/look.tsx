// The panel of the view, and that of the history.
import type { App } from '../app';
import * as store from '../model/store';
import { EDITS, SHADINGS, SHAPES } from '../model/texts';
import { Check, Choice, Section, Slider } from './parts';

export function ViewPanel({ app }: { app: App }) {
  const { layers } = store.state.value;
  const shapes = (Object.keys(SHAPES) as store.Shape[]).filter((s) => layers[s]);
  const shadings = (Object.keys(SHADINGS) as store.Shading[]).filter((s) => store.canShade(s, store.shape.value));
  const show = store.show.value;
  const toggle = (name: keyof typeof show) => (on: boolean) => {
    store.show.value = { ...show, [name]: on };
  };
  const section = store.section.value;
  return (
    <>
      <Section title="Shape">
        <Choice
          label="Shape"
          value={store.shape.value}
          options={shapes.map((s) => [s, SHAPES[s]] as const)}
          onPick={store.showShape}
        />
      </Section>
      {store.shape.value !== 'points' && (
        <Section title="Shading">
          <Choice
            label="Shading"
            value={store.shading.value}
            options={shadings.map((s) => [s, SHADINGS[s]] as const)}
            onPick={(s) => {
              store.shading.value = s;
            }}
          />
        </Section>
      )}
      <Section title="Lines">
        <Check label="Curves" value={show.curves} onPick={toggle('curves')} />
        <Check label="Corners" value={show.corners} onPick={toggle('corners')} />
        {layers.isolines && <Check label="Iso-curves" value={show.isolines} onPick={toggle('isolines')} />}
        {layers.nets && <Check label="Control nets" value={show.nets} onPick={toggle('nets')} />}
      </Section>
      <Section title="Section">
        <Check
          label="Cut the view open"
          value={section.on}
          onPick={(on) => {
            store.section.value = { ...section, on };
          }}
        />
        {section.on && (
          <>
            <Choice
              label="Axis of the section"
              value={`${section.axis}`}
              options={[
                ['0', 'X'],
                ['1', 'Y'],
                ['2', 'Z'],
              ]}
              onPick={(axis) => {
                store.section.value = { ...section, axis: Number(axis) as 0 | 1 | 2 };
              }}
            />
            <Slider
              label="Place"
              value={section.at}
              min={0}
              max={1}
              step={0.005}
              show={(v) => `${Math.round(100 * v)} %`}
              onInput={(at) => {
                store.section.value = { ...section, at };
              }}
            />
            <Check
              label="The other side"
              value={section.flip}
              onPick={(flip) => {
                store.section.value = { ...section, flip };
              }}
            />
          </>
        )}
      </Section>
      <Section title="Camera">
        <div class="row views">
          {(['front', 'right', 'top', 'back', 'left', 'bottom'] as const).map((name) => (
            <button
              type="button"
              key={name}
              class="small"
              onClick={() => {
                app.view.rig.look(name);
                app.view.moved();
              }}
            >
              {name[0]!.toUpperCase() + name.slice(1)}
            </button>
          ))}
        </div>
        <Check
          label="Parallel projection"
          value={store.parallel.value}
          onPick={(on) => {
            store.parallel.value = on;
          }}
        />
        <Check
          label="Turn freely, without an up"
          value={store.orbit.value === 'free'}
          onPick={(on) => {
            store.orbit.value = on ? 'free' : 'turntable';
          }}
        />
        <Check
          label="Y is up"
          value={store.up.value === 'y'}
          onPick={(on) => {
            store.up.value = on ? 'y' : 'z';
            app.view.rig.look('corner');
            app.view.moved();
          }}
        />
      </Section>
    </>
  );
}

export function HistoryPanel({ app }: { app: App }) {
  const { done, undone } = store.state.value;
  const name = (edit: string) => EDITS[edit] ?? edit;
  const back = (count: number) => void app.edit({ edit: 'undo', count });
  const forth = (count: number) => void app.edit({ edit: 'redo', count });
  return (
    <Section title="History">
      {done.length + undone.length === 0 && <p class="faint">Every edit is kept here, across restarts.</p>}
      <ol class="history">
        {done.length > 0 && (
          <li>
            <button type="button" onClick={() => back(done.length)}>
              As it began
            </button>
          </li>
        )}
        {done.map((step, k) => (
          <li key={k} class={k === done.length - 1 ? 'now' : ''}>
            <button
              type="button"
              aria-current={k === done.length - 1 ? 'step' : undefined}
              onClick={() => k < done.length - 1 && back(done.length - 1 - k)}
            >
              {name(step.edit)}
              <span class="number faint">{step.counts[1]} curves</span>
            </button>
          </li>
        ))}
        {[...undone].reverse().map((step, k) => (
          <li key={`u${k}`} class="undone">
            <button type="button" onClick={() => forth(k + 1)}>
              {name(step.edit)}
            </button>
          </li>
        ))}
      </ol>
      {done.length > 0 && (
        <button type="button" onClick={() => void app.script()}>
          Save as a script
        </button>
      )}
    </Section>
  );
}
