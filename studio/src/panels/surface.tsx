// The panel of the surfaces: how fine they are, how near they come, how they meet, and files of them.
import { signal } from '@preact/signals';
import type { App } from '../app';
import { digits, length } from '../model/format';
import * as store from '../model/store';
import { FORMATS, TEXT } from '../model/texts';
import { Check, Choice, Fact, Section, Slider } from './parts';

const words = TEXT.surface;
/** Tolerances of the slider, of the diagonal. */
const TOLERANCES = [1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5];
const draft = signal<number | null>(null);

export function SurfacePanel({ app }: { app: App }) {
  return (
    <>
      <Fineness app={app} />
      <Measured app={app} />
      <Files app={app} />
    </>
  );
}

function Fineness({ app }: { app: App }) {
  const { resolution, live, project, patches, faults } = store.state.value;
  const diagonal = project?.diagonal ?? 1;
  const units = project?.units ?? '';
  const how = 'tolerance' in resolution ? 'tolerance' : 'control' in resolution ? 'control' : 'per_curve';
  const tolerance = 'tolerance' in resolution ? resolution.tolerance : 1e-3;
  const control = 'control' in resolution ? resolution.control[0] : 8;
  const nearest = TOLERANCES.reduce(
    (a, b, k) => (Math.abs(Math.log(b / tolerance)) < Math.abs(Math.log(TOLERANCES[a]! / tolerance)) ? k : a),
    0,
  );
  const finished = patches.length > 0 && faults.length === 0;
  return (
    <Section title={words.title}>
      <Choice
        label={words.label}
        value={how}
        options={[
          ['tolerance', words.byTolerance],
          ['control', words.byNumber],
          ...(how === 'per_curve' ? ([['per_curve', words.perPatch]] as const) : []),
        ]}
        onPick={(value) => {
          draft.value = null;
          if (value === 'tolerance') void app.setting({ tolerance: 1e-3 }, live);
          if (value === 'control') void app.setting({ control: [8, 8] }, live);
        }}
      />
      {how === 'tolerance' && (
        <Slider
          label={words.tolerance}
          value={draft.value ?? nearest}
          min={0}
          max={TOLERANCES.length - 1}
          step={1}
          show={(k) => length(TOLERANCES[k]! * diagonal, units)}
          onInput={(k) => {
            draft.value = k;
          }}
          onChange={(k) => {
            draft.value = null;
            void app.setting({ tolerance: TOLERANCES[k]! }, live);
          }}
        />
      )}
      {how === 'control' && (
        <Slider
          label={words.control}
          value={draft.value ?? control}
          min={4}
          max={64}
          step={1}
          show={String}
          onInput={(k) => {
            draft.value = k;
          }}
          onChange={(k) => {
            draft.value = null;
            void app.setting({ control: [k, k] }, live);
          }}
        />
      )}
      {how === 'per_curve' && <p class="faint">{words.single}</p>}
      <Check label={words.live} value={live} onPick={(on) => void app.setting(resolution, on)} />
      {finished && (
        <div class="row">
          <button type="button" class="primary" onClick={() => void app.fit()}>
            {words.fit}
          </button>
          <button type="button" onClick={() => void app.fitCoarse()}>
            {words.coarse}
          </button>
        </div>
      )}
    </Section>
  );
}

function Measured({ app }: { app: App }) {
  const { figures, project, seams, warnings, layers, stages } = store.state.value;
  const units = project?.units ?? '';
  if (figures['surface.rms'] === undefined) {
    const isFresh = stages.some((s) => s.name === 'surfaces' && s.is === 'fresh');
    if (!isFresh) return null;
    return (
      <Section title={words.measured}>
        <p class="faint">{words.measuring}</p>
        {layers.surfaces && <Histogram />}
      </Section>
    );
  }
  const rows: [string, string][] = [
    [words.rms, length(figures['surface.rms']!, units)],
    [words.max, length(figures['surface.max'] ?? 0, units)],
    [words.points, String(figures['surface.control_points'] ?? '')],
    [words.folds, String(figures['grid.folds'] ?? 0)],
    [words.gap, length(figures['seam.gap_max'] ?? 0, units)],
    [words.angle, `${digits(figures['seam.angle_max_deg'] ?? 0)}°`],
  ];
  const worst = seams.filter((s) => !s.sharp).slice(0, 5);
  return (
    <Section title={words.measured}>
      <dl>
        {rows.map(([name, value]) => (
          <Fact key={name} name={name} value={value} />
        ))}
      </dl>
      {layers.surfaces && <Histogram />}
      {worst.length > 0 && (
        <>
          <h3>{words.worst}</h3>
          <ul class="list">
            {worst.map((s) => (
              <li key={s.curve}>
                <button
                  type="button"
                  class="link"
                  onClick={() => {
                    store.selected.value = { kind: 'curve', index: s.curve };
                    flyToCurve(app, s.curve);
                  }}
                >
                  {words.curve(s.curve)}
                </button>
                <span class="number">{s.angle_deg.toFixed(2)}°</span>
              </li>
            ))}
          </ul>
        </>
      )}
      {warnings.map((w) => (
        <p key={w} class="warning">
          {w}
        </p>
      ))}
    </Section>
  );
}

function flyToCurve(app: App, curve: number): void {
  const { position, offset } = app.view.curves;
  const middle = Math.floor((offset[curve]! + offset[curve + 1]!) / 2);
  const center = store.state.value.project?.center ?? [0, 0, 0];
  app.fly([0, 1, 2].map((k) => position[3 * middle + k]! + center[k]!));
}

/** Bars of the histogram. */
const BARS = 41;

/** How often each deviation is found. */
export function histogram(values: Float32Array, most: number, bars = BARS): number[] {
  const counts = new Array<number>(bars).fill(0);
  for (const v of values) {
    const k = Math.round(((v / most + 1) / 2) * (bars - 1));
    counts[Math.min(bars - 1, Math.max(0, k))]!++;
  }
  return counts;
}

function Histogram() {
  const values = store.geometry.value.get('surfaces')?.floats.get('deviation');
  if (!values || store.shading.value !== 'deviation') return null;
  const most = store.scaleFound.value;
  const counts = histogram(values, most);
  const high = Math.max(...counts);
  const units = store.state.value.project?.units ?? '';
  return (
    <figure class="histogram">
      <svg viewBox={`0 0 ${BARS} 20`} preserveAspectRatio="none" role="img" aria-label={words.histogram}>
        {counts.map((n, k) => (
          <rect key={k} x={k + 0.1} width={0.8} y={20 - (20 * n) / high} height={(20 * n) / high} />
        ))}
      </svg>
      <figcaption>
        <span>−{length(most, units)}</span>
        <span>0</span>
        <span>{length(most, units)}</span>
      </figcaption>
    </figure>
  );
}

function Files({ app }: { app: App }) {
  const state = store.state.value;
  const fresh = state.stages.find((s) => s.name === 'surfaces')?.is === 'fresh';
  return (
    <Section title={words.files}>
      {fresh ? (
        <div class="formats">
          {FORMATS.map((f) => (
            <button type="button" key={f.format} onClick={() => void app.export(f.format)}>
              <strong>{f.name}</strong>
              <span>{f.note}</span>
            </button>
          ))}
        </div>
      ) : (
        <p class="faint">{words.stale}</p>
      )}
    </Section>
  );
}
