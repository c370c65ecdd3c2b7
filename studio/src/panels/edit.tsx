// The panel of the drawing: what is selected, the network, what is left to put right.
import { signal } from '@preact/signals';
import type { App } from '../app';
import { length, plural } from '../model/format';
import * as store from '../model/store';
import type { Fault } from '../protocol/types';
import { NextStep } from './bars';
import { Choice, Fact, Section, Slider } from './parts';

const patches = signal(24);
const sharp = signal(40);

export function EditPanel({ app }: { app: App }) {
  const state = store.state.value;
  const hasMesh = Boolean(state.layers.mesh);
  return (
    <>
      <NextStep app={app} patches={patches.value} />
      {!hasMesh && <ScanSection app={app} />}
      <ToolOptions />
      <Selection app={app} />
      {hasMesh && <Faults app={app} />}
      {hasMesh && <Network app={app} />}
    </>
  );
}

function ScanSection({ app }: { app: App }) {
  return (
    <Section title="Mesh of the scan">
      <p class="faint">Cells, noise and outliers are told from the points. Holes can be closed or stay open.</p>
      <div class="row">
        <button type="button" onClick={() => void app.mesh(true)}>
          Close holes
        </button>
        <button type="button" onClick={() => void app.mesh(false)}>
          Leave holes open
        </button>
      </div>
    </Section>
  );
}

function ToolOptions() {
  const tool = store.tool.value;
  if (tool === 'paint' || tool === 'feature') {
    return (
      <Section title="Between the picks">
        <Choice
          label="Way between the picks"
          value={store.paintMode.value}
          options={[
            ['straight', 'Straight'],
            ['geodesic', 'Shortest'],
            ['magnetic', 'Magnetic'],
          ]}
          onPick={(value) => {
            store.paintMode.value = value;
          }}
        />
        <p class="faint">
          {store.paintMode.value === 'straight' && 'As near to a straight line as the surface allows.'}
          {store.paintMode.value === 'geodesic' && 'The shortest way over the surface.'}
          {store.paintMode.value === 'magnetic' && 'Drawn to ridges and valleys.'}
        </p>
      </Section>
    );
  }
  if (tool === 'drag') {
    return (
      <Section title="What follows">
        <Slider
          label="Share of the curve"
          value={store.dragWidth.value}
          min={0.1}
          max={1}
          step={0.05}
          show={(v) => `${Math.round(100 * v)} %`}
          onInput={(v) => {
            store.dragWidth.value = v;
          }}
        />
      </Section>
    );
  }
  return null;
}

function Selection({ app }: { app: App }) {
  const picked = store.selected.value;
  const state = store.state.value;
  if (!picked) return null;
  const units = state.project?.units ?? '';
  if (picked.kind === 'corner') {
    const curves = state.curves.flatMap((c) => c.ends.filter((e) => e === picked.index)).length;
    return (
      <Section title={`Corner ${picked.index}`}>
        <dl>
          <Fact name="Curves" value={String(curves)} />
        </dl>
        {(curves === 0 || curves === 2) && (
          <button type="button" onClick={() => app.remove()}>
            {curves === 2 ? 'Join its curves' : 'Delete'}
          </button>
        )}
      </Section>
    );
  }
  if (picked.kind === 'feature') {
    return (
      <Section title={`Feature curve ${picked.index}`}>
        <p class="faint">The grid of its patch follows it.</p>
        <div class="row">
          <button type="button" onClick={() => void app.edit({ edit: 'relax', curve: { feature: picked.index } })}>
            Relax
          </button>
          <button type="button" onClick={() => app.remove()}>
            Delete
          </button>
        </div>
      </Section>
    );
  }
  if (picked.kind === 'patch') return <PatchSelection app={app} index={picked.index} units={units} />;
  return <CurveSelection app={app} index={picked.index} units={units} />;
}

function CurveSelection({ app, index, units }: { app: App; index: number; units: string }) {
  const state = store.state.value;
  const curve = state.curves[index];
  if (!curve) return null;
  const seam = state.seams.find((s) => s.curve === index);
  return (
    <Section title={`Curve ${index}`}>
      <dl>
        <Fact name="Length" value={length(curve.length, units)} />
        {curve.control != null && <Fact name="Control points" value={String(curve.control)} />}
        {seam && <Fact name="Largest angle of the seam" value={`${seam.angle_deg.toFixed(2)}°`} />}
      </dl>
      {curve.kind !== 'boundary' && (
        <Choice
          label="Seam along the curve"
          value={curve.kind}
          options={[
            ['smooth', 'Smooth seam'],
            ['feature', 'Sharp seam'],
          ]}
          onPick={(kind) =>
            void app.edit({ edit: 'continuity', curves: [index], seam: kind === 'feature' ? 'sharp' : 'smooth' })
          }
        />
      )}
      <div class="row">
        {curve.kind === 'smooth' && (
          <button type="button" onClick={() => void app.edit({ edit: 'relax', curve: index })}>
            Relax
          </button>
        )}
        {curve.kind === 'smooth' && (
          <button type="button" onClick={() => void app.edit({ edit: 'spline', curve: index, control: 8 })}>
            Smooth as a spline
          </button>
        )}
        <button type="button" onClick={() => void app.edit({ edit: 'split_curve', curve: index, at: 0.5 })}>
          Divide
        </button>
        <button type="button" onClick={() => app.remove()}>
          Delete
        </button>
      </div>
    </Section>
  );
}

function PatchSelection({ app, index, units }: { app: App; index: number; units: string }) {
  const state = store.state.value;
  const patch = state.patches[index];
  if (!patch) return null;
  const alone = store.isolated.value === index;
  const control = patch.fitted?.control;
  const set = (along: 0 | 1, value: number) => {
    // Curves on opposite sides share their number: only those of this patch are named, the others keep theirs.
    const list = state.curves.map((c) => c.control ?? 8);
    for (const k of [along, along + 2]) list[patch.curves[k]!] = value;
    void app.setting({ per_curve: list }, state.live);
  };
  return (
    <Section title={`Patch ${index}`}>
      {patch.fitted && (
        <dl>
          <Fact name="Distance, RMS" value={length(patch.fitted.rms, units)} />
          <Fact name="Distance, largest" value={length(patch.fitted.max, units)} />
        </dl>
      )}
      {control && (
        <div class="row numbers">
          {([0, 1] as const).map((along) => (
            <label key={along}>
              Control points, {along === 0 ? 'u' : 'v'}
              <input
                type="number"
                min={4}
                max={128}
                value={control[along]}
                onChange={(e) => set(along, Math.min(128, Math.max(4, Math.round(Number(e.currentTarget.value) || 4))))}
              />
            </label>
          ))}
        </div>
      )}
      <button
        type="button"
        aria-pressed={alone}
        onClick={() => {
          store.isolated.value = alone ? null : index;
        }}
      >
        {alone ? 'Show all patches' : 'Show it alone'}
      </button>
    </Section>
  );
}

function Faults({ app }: { app: App }) {
  const { faults, curves } = store.state.value;
  if (faults.length === 0 || curves.length === 0) return null;
  const mend = (fault: Fault) => {
    const at = fault.why.place;
    if (fault.offer === 'boundaries') void app.edit({ edit: 'boundaries' });
    if (fault.offer === 'split_region' && at) void app.edit({ edit: 'split_region', at });
    if (fault.offer === 'delete_corner' && at) void app.edit({ edit: 'delete_corner', corner: { near: at } });
  };
  const word = { boundaries: 'Draw it', split_region: 'Split it', delete_corner: 'Delete it' };
  return (
    <Section title={`To put right (${faults.length})`}>
      <ul class="faults">
        {faults.slice(0, 8).map((fault) => (
          <li key={fault.why.message}>
            <p>{capital(short(fault.why.message))}</p>
            {fault.why.hint && <p class="faint">{capital(fault.why.hint)}</p>}
            <div class="row">
              {fault.why.place && (
                <button type="button" class="small" onClick={() => app.fly(fault.why.place!)}>
                  Show
                </button>
              )}
              {fault.offer && (
                <button type="button" class="small" onClick={() => mend(fault)}>
                  {word[fault.offer]}
                </button>
              )}
            </div>
          </li>
        ))}
      </ul>
      {faults.length > 8 && <p class="faint">and {plural(faults.length - 8, 'more place')}</p>}
    </Section>
  );
}

/** A message without its coordinates: the button shows the place. */
export function short(message: string): string {
  return message.replace(/ ?(at |around )?\(-?[\d.e-]+, -?[\d.e-]+, -?[\d.e-]+\)/g, '');
}

/** The first letter large. */
export function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function Network({ app }: { app: App }) {
  const state = store.state.value;
  const has = state.curves.length > 0;
  const finished = state.patches.length > 0 && state.faults.length === 0;
  return (
    <Section title="Network">
      <Slider
        label="Patches, about"
        value={patches.value}
        min={6}
        max={200}
        step={1}
        show={String}
        onInput={(v) => {
          patches.value = v;
        }}
      />
      <div class="row">
        {!finished && (
          <button type="button" onClick={() => void app.complete(patches.value, sharp.value)}>
            {has ? 'Complete the rest' : 'Lay out patches'}
          </button>
        )}
        {has && (
          <button type="button" onClick={() => void app.edit({ edit: 'relax' })}>
            Relax all
          </button>
        )}
      </div>
      <Slider
        label="Sharp edges above"
        value={sharp.value}
        min={10}
        max={120}
        step={5}
        show={(v) => `${v}°`}
        onInput={(v) => {
          sharp.value = v;
        }}
      />
      <div class="row">
        <button
          type="button"
          onClick={() => void app.edit({ edit: 'feature_lines', angle_deg: sharp.value, shortest: 0.05 })}
        >
          Draw sharp edges
        </button>
        <button type="button" onClick={() => void app.edit({ edit: 'boundaries' })}>
          Draw boundaries
        </button>
      </div>
      <div class="row">
        <button type="button" onClick={() => void app.edit({ edit: 'symmetry' })}>
          Find symmetry
        </button>
        {state.symmetry && has && (
          <>
            <button type="button" onClick={() => void app.edit({ edit: 'mirror' })}>
              Mirror
            </button>
            <button type="button" onClick={() => void app.edit({ edit: 'mirror', swap: true })}>
              Mirror back
            </button>
          </>
        )}
        {has && (
          <button type="button" onClick={() => void app.edit({ edit: 'clear' })}>
            Delete all curves
          </button>
        )}
      </div>
    </Section>
  );
}
