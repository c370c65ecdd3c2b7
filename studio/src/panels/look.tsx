// The panel of the view, and that of the history.
import type { App } from '../app';
import { length } from '../model/format';
import * as store from '../model/store';
import { EDITS, SHADINGS, SHAPES, TEXT, VIEWS } from '../model/texts';
import { Check, Choice, Section, Slider } from './parts';

const words = TEXT.look;

export function ViewPanel({ app }: { app: App }) {
  const { layers } = store.state.value;
  const shapes = (Object.keys(SHAPES) as store.Shape[]).filter((s) => layers[s]);
  const shadings = (Object.keys(SHADINGS) as store.Shading[]).filter((s) => store.canShade(s, store.shape.value));
  const show = store.show.value;
  const toggle = (name: keyof typeof show) => (on: boolean) => {
    store.show.value = { ...show, [name]: on };
  };
  const section = store.section.value;
  const units = store.state.value.project?.units ?? '';
  const hidden = store.hidden.value.size;
  return (
    <>
      <Section title={words.shape}>
        <Choice
          label={words.shape}
          value={store.shape.value}
          options={shapes.map((s) => [s, SHAPES[s]] as const)}
          onPick={store.showShape}
        />
      </Section>
      {store.shape.value !== 'points' && (
        <Section title={words.shading}>
          <Choice
            label={words.shading}
            value={store.shading.value}
            options={shadings.map((s) => [s, SHADINGS[s]] as const)}
            onPick={(s) => {
              store.shading.value = s;
            }}
          />
          {(store.shading.value === 'deviation' || store.shading.value === 'curvature') && (
            <Slider
              label={words.scale}
              value={Math.log10(store.scaleShare.value)}
              min={-1}
              max={1}
              step={0.1}
              show={() =>
                length(store.scaleFound.value, store.shading.value === 'deviation' ? units : units && `1/${units}`)
              }
              onInput={(v) => {
                store.scaleShare.value = 10 ** v;
              }}
            />
          )}
        </Section>
      )}
      <Section title={words.lines}>
        <Check label={words.curves} value={show.curves} onPick={toggle('curves')} />
        <Check label={words.corners} value={show.corners} onPick={toggle('corners')} />
        {store.state.value.seams.length > 0 && (
          <Check label={words.angles} value={show.angles} onPick={toggle('angles')} />
        )}
        {layers.isolines && <Check label={words.isolines} value={show.isolines} onPick={toggle('isolines')} />}
        {layers.nets && <Check label={words.nets} value={show.nets} onPick={toggle('nets')} />}
      </Section>
      {(hidden > 0 || store.isolated.value !== null) && (
        <Section title={SHADINGS.patches}>
          {hidden > 0 && <p class="faint">{words.hidden(hidden)}</p>}
          <button type="button" onClick={() => app.showAll()}>
            {words.showAll}
          </button>
        </Section>
      )}
      <Section title={words.section}>
        <Check
          label={words.cut}
          value={section.on}
          onPick={(on) => {
            store.section.value = { ...section, on };
          }}
        />
        {section.on && (
          <>
            <Choice
              label={words.axis}
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
              label={words.place}
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
              label={words.flip}
              value={section.flip}
              onPick={(flip) => {
                store.section.value = { ...section, flip };
              }}
            />
          </>
        )}
      </Section>
      <Section title={words.camera}>
        <div class="row views">
          {(Object.keys(VIEWS) as (keyof typeof VIEWS)[]).map((name) => (
            <button
              type="button"
              key={name}
              class="small"
              onClick={() => {
                app.view.rig.look(name);
                app.view.moved();
              }}
            >
              {VIEWS[name]}
            </button>
          ))}
        </div>
        <Check
          label={words.parallel}
          value={store.parallel.value}
          onPick={(on) => {
            store.parallel.value = on;
          }}
        />
        <Check
          label={words.free}
          value={store.orbit.value === 'free'}
          onPick={(on) => {
            store.orbit.value = on ? 'free' : 'turntable';
          }}
        />
        <Check
          label={words.yUp}
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
  const { done, undone, branches } = store.state.value;
  const told = TEXT.history;
  const name = (edit: string) => EDITS[edit] ?? edit;
  return (
    <>
      <Section title={told.title}>
        {done.length + undone.length === 0 && <p class="faint">{told.empty}</p>}
        <ol class="history">
          {done.length > 0 && (
            <li>
              <button type="button" onClick={() => void app.back(done.length)}>
                {told.began}
              </button>
            </li>
          )}
          {done.map((step, k) => (
            <li key={k} class={k === done.length - 1 ? 'now' : ''}>
              <button
                type="button"
                aria-current={k === done.length - 1 ? 'step' : undefined}
                onClick={() => k < done.length - 1 && void app.back(done.length - 1 - k)}
              >
                {name(step.edit)}
                {step.counts && <span class="number faint">{told.curves(step.counts[1])}</span>}
              </button>
            </li>
          ))}
          {[...undone].reverse().map((step, k) => (
            <li key={`u${k}`} class="undone">
              <button type="button" onClick={() => void app.forth(k + 1)}>
                {name(step.edit)}
              </button>
            </li>
          ))}
        </ol>
        {done.some((step) => step.counts) && (
          <button type="button" onClick={() => void app.script()}>
            {told.script}
          </button>
        )}
      </Section>
      {branches.length > 0 && (
        <Section title={told.branches}>
          <p class="faint">{told.branchNote}</p>
          <ul class="list">
            {branches
              .map((branch, k) => ({ branch, k }))
              .reverse()
              .map(({ branch, k }) => (
                <li key={k}>
                  <span>{told.branch(branch.own.slice(0, 2).map(name).join(', '), branch.own.length - 2)}</span>
                  <button type="button" class="small" onClick={() => void app.branch(k)}>
                    {told.go}
                  </button>
                </li>
              ))}
          </ul>
        </Section>
      )}
    </>
  );
}
