// What is selected, and what can be done with it.
import { signal } from '@preact/signals';
import type { App } from '../app';
import { digits, length } from '../model/format';
import * as store from '../model/store';
import { TEXT } from '../model/texts';
import type { CurveName, Edit, Message, Pull } from '../protocol/types';
import { Choice, Fact, Section } from './parts';

/** Fewest and most control points along a curve that the panel offers. */
const CONTROL = { least: 4, most: 128 };

export function Selection({ app }: { app: App }) {
  const picked = store.selected.value;
  if (!picked) return null;
  if (picked.kind === 'corner') return <CornerSelection app={app} index={picked.index} />;
  if (picked.kind === 'feature') {
    return (
      <Section title={TEXT.feature.title(picked.index)}>
        <p class="faint">{TEXT.feature.note}</p>
        <CurveActions app={app} picked={picked} />
      </Section>
    );
  }
  if (picked.kind === 'patch') return <PatchSelection app={app} index={picked.index} />;
  return <CurveSelection app={app} picked={picked} />;
}

function CornerSelection({ app, index }: { app: App; index: number }) {
  const words = TEXT.corner;
  const curves = store.state.value.curves.flatMap((c) => c.ends.filter((e) => e === index)).length;
  return (
    <Section title={words.title(index)}>
      <dl>
        <Fact name={words.curves} value={String(curves)} />
      </dl>
      {(curves === 0 || curves === 2) && (
        <button type="button" onClick={() => app.remove()}>
          {curves === 2 ? words.join : words.remove}
        </button>
      )}
    </Section>
  );
}

function CurveSelection({ app, picked }: { app: App; picked: store.Picked }) {
  const state = store.state.value;
  const words = TEXT.curve;
  const curve = state.curves[picked.index];
  if (!curve) return null;
  const seam = state.seams.find((s) => s.curve === picked.index);
  const units = state.project?.units ?? '';
  return (
    <Section title={words.title(picked.index)}>
      <dl>
        <Fact name={words.length} value={length(curve.length, units)} />
        {curve.control != null && <Fact name={words.control} value={String(curve.control)} />}
        {seam && <Fact name={words.angle} value={`${seam.angle_deg.toFixed(2)}°`} />}
      </dl>
      {curve.kind !== 'boundary' && (
        <Choice
          label={words.seam}
          value={curve.kind}
          options={[
            ['smooth', words.smooth],
            ['feature', words.sharp],
          ]}
          onPick={(kind) =>
            void app.edit({ edit: 'continuity', curves: [picked.index], seam: kind === 'feature' ? 'sharp' : 'smooth' })
          }
        />
      )}
      <CurveActions app={app} picked={picked} />
    </Section>
  );
}

/** A curve relaxes within what holds it. */
function relaxed(picked: store.Picked, pull?: Pull): Edit {
  const kept = store.holds.value;
  const own = kept && kept.picked.kind === picked.kind && kept.picked.index === picked.index ? kept : null;
  const { pins = [], stretches = [] } = own ?? {};
  return {
    edit: 'relax',
    curve: nameOf(picked),
    ...(pins.length > 0 ? { pins } : {}),
    ...(stretches.length > 0 ? { stiffness: stretches } : {}),
    ...(pull ? { pull } : {}),
  };
}

function nameOf(picked: store.Picked): CurveName {
  return picked.kind === 'feature' ? { feature: picked.index } : picked.index;
}

function CurveActions({ app, picked }: { app: App; picked: store.Picked }) {
  const state = store.state.value;
  const words = TEXT.curve;
  const isFeature = picked.kind === 'feature';
  const moves = isFeature || state.curves[picked.index]?.kind === 'smooth';
  const hasColour = state.project?.coloured ?? false;
  const pulls: [string, Pull][] = [
    [words.ridges, { scalar: 'mean_curvature' }],
    [words.valleys, { scalar: 'mean_curvature', low: true }],
    ...(hasColour
      ? ([
          [words.bright, { scalar: 'luminance' }],
          [words.dim, { scalar: 'luminance', low: true }],
        ] as [string, Pull][])
      : []),
  ];
  return (
    <div class="row">
      {moves && (
        <>
          <button type="button" onClick={() => void app.edit(relaxed(picked))}>
            {words.relax}
          </button>
          {pulls.map(([name, pull]) => (
            <button type="button" key={name} onClick={() => void app.edit(relaxed(picked, pull))}>
              {name}
            </button>
          ))}
          <button
            type="button"
            onClick={() => void app.edit({ edit: 'spline', curve: nameOf(picked), control: store.handleCount.value })}
          >
            {words.spline}
          </button>
          <button type="button" onClick={() => app.handlesOf(picked)}>
            {words.handles}
          </button>
        </>
      )}
      {!isFeature && (
        <button type="button" onClick={() => void app.edit({ edit: 'split_curve', curve: picked.index, at: 0.5 })}>
          {words.divide}
        </button>
      )}
      <button type="button" onClick={() => app.remove()}>
        {words.remove}
      </button>
    </div>
  );
}

type Tried = Extract<Message, { type: 'tried_patch' }> & { patch: number };
const tried = signal<Tried | null>(null);
const tolerance = signal('');

async function tryOut(
  app: App,
  patch: number,
  body: { control: [number, number] } | { tolerance: number },
): Promise<void> {
  const answer = await app.ask({ type: 'try_patch', patch, ...body });
  if (answer?.type === 'tried_patch') tried.value = { ...answer, patch };
}

function PatchSelection({ app, index }: { app: App; index: number }) {
  const state = store.state.value;
  const words = TEXT.patch;
  const patch = state.patches[index];
  if (!patch) return null;
  const units = state.project?.units ?? '';
  const alone = store.isolated.value === index;
  const { fitted } = patch;
  const found = tried.value?.patch === index ? tried.value : null;
  return (
    <Section title={words.title(index)}>
      {fitted && (
        <dl>
          <Fact name={words.rms} value={length(fitted.rms, units)} />
          <Fact name={words.max} value={length(fitted.max, units)} />
          <Fact name={words.cells} value={`${fitted.cells[0]} x ${fitted.cells[1]}`} />
        </dl>
      )}
      {fitted && <Numbers app={app} index={index} control={found?.control ?? fitted.control} />}
      {fitted && (
        <div class="row numbers">
          <label>
            {words.tolerance}, {units}
            <input
              type="number"
              min={0}
              step="any"
              placeholder={digits(fitted.rms)}
              value={tolerance.value}
              onInput={(e) => {
                tolerance.value = e.currentTarget.value;
              }}
            />
          </label>
          <button
            type="button"
            disabled={!(Number(tolerance.value) > 0)}
            onClick={() => void tryOut(app, index, { tolerance: Number(tolerance.value) })}
          >
            {words.toleranceDo}
          </button>
        </div>
      )}
      {found && (
        <>
          <p class="faint" role="status">
            {words.tried(length(found.rms, units))}
          </p>
          <button
            type="button"
            onClick={() => {
              take(app, index, found.control);
              tried.value = null;
            }}
          >
            {words.take(found.control[0], found.control[1])}
          </button>
        </>
      )}
      <Sections app={app} index={index} />
      <div class="row">
        <button
          type="button"
          aria-pressed={alone}
          onClick={() => {
            store.isolated.value = alone ? null : index;
          }}
        >
          {alone ? words.all : words.alone}
        </button>
        <button
          type="button"
          onClick={() => {
            store.hidden.value = new Set([...store.hidden.value, index]);
            store.isolated.value = null;
            store.selected.value = null;
          }}
        >
          {words.hide}
        </button>
        {fitted && (
          <button
            type="button"
            onClick={() => {
              store.tab.value = 'relief';
            }}
          >
            {words.relief}
          </button>
        )}
      </div>
    </Section>
  );
}

/** Curves on opposite sides share their number: only those of this patch are named, the others keep theirs. */
function take(app: App, index: number, control: [number, number]): void {
  const state = store.state.value;
  const patch = state.patches[index]!;
  const list = state.curves.map((c) => c.control ?? 8);
  for (const k of [0, 1, 2, 3]) list[patch.curves[k]!] = control[k % 2]!;
  void app.setting({ per_curve: list }, state.live);
}

function Numbers({ app, index, control }: { app: App; index: number; control: [number, number] }) {
  const clamp = (n: number) => Math.min(CONTROL.most, Math.max(CONTROL.least, Math.round(n) || CONTROL.least));
  const changed = (along: 0 | 1, value: number): [number, number] =>
    along === 0 ? [clamp(value), control[1]] : [control[0], clamp(value)];
  return (
    <div class="row numbers">
      {([0, 1] as const).map((along) => (
        <label key={along}>
          {TEXT.patch.control(along === 0 ? 'u' : 'v')}
          <input
            type="number"
            min={CONTROL.least}
            max={CONTROL.most}
            value={control[along]}
            onInput={(e) => {
              const value = Number(e.currentTarget.value);
              if (value >= CONTROL.least) void tryOut(app, index, { control: changed(along, value) });
            }}
          />
        </label>
      ))}
    </div>
  );
}

const cells = signal<{ key: string; lists: [number[], number[]] } | null>(null);

/** Cells of each section between the feature curves of a patch. */
function Sections({ app, index }: { app: App; index: number }) {
  const state = store.state.value;
  const patch = state.patches[index]!;
  const words = TEXT.patch;
  if (!patch.fitted) return null;
  const key = `${index} ${state.revision}`;
  const usual = ([0, 1] as const).map((k) => {
    const [asked, parts] = [patch.sections[k]!, patch.parts[k]!];
    const even = Math.max(2, Math.round(patch.fitted!.cells[k]! / parts));
    return asked.length === parts ? [...asked] : new Array<number>(parts).fill(even);
  }) as [number[], number[]];
  const lists = cells.value?.key === key ? cells.value.lists : usual;
  const set = (along: 0 | 1, part: number, value: number) => {
    const next = lists.map((l) => [...l]) as [number[], number[]];
    next[along]![part] = Math.max(2, Math.round(value) || 2);
    cells.value = { key, lists: next };
  };
  const at = () => app.insideOf(index);
  return (
    <details>
      <summary>{words.sections}</summary>
      <div class="row numbers">
        {([0, 1] as const).flatMap((along) =>
          lists[along].map((n, part) => (
            <label key={`${along} ${part}`}>
              {words.section(along === 0 ? 'u' : 'v', part + 1)}
              <input
                type="number"
                min={2}
                max={2048}
                value={n}
                onInput={(e) => set(along, part, Number(e.currentTarget.value))}
              />
            </label>
          )),
        )}
      </div>
      <div class="row">
        <button
          type="button"
          onClick={() => {
            const place = at();
            if (place) void app.edit({ edit: 'sections', at: place, u: lists[0], v: lists[1] });
          }}
        >
          {words.refine}
        </button>
        {(patch.sections[0].length > 0 || patch.sections[1].length > 0) && (
          <button
            type="button"
            onClick={() => {
              const place = at();
              if (place) void app.edit({ edit: 'sections', at: place });
            }}
          >
            {words.usual}
          </button>
        )}
      </div>
    </details>
  );
}
