// The panel of the relief: the map of a patch as an image, how strong it is shown, and which waves.
import { signal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import type { App } from '../app';
import { length } from '../model/format';
import * as store from '../model/store';
import { TEXT } from '../model/texts';
import type { Message } from '../protocol/types';
import { usualMost } from '../view/scale';
import { Choice, Fact, Section, Slider } from './parts';

type DisplacementMap = Extract<Message, { type: 'map' }>;
/** Wavelengths of the slider, of the diagonal. */
const WAVELENGTHS = [0.2, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005];
const patch = signal(0);
const map = signal<DisplacementMap | null>(null);
const draft = signal<number | null>(null);

/** Blue below the surface, red above, as in the view. */
export function tint(share: number): [number, number, number] {
  const t = Math.min(1, Math.abs(share));
  const [near, mid, far] = [
    [240, 240, 235],
    share < 0 ? [102, 168, 224] : [245, 153, 107],
    share < 0 ? [23, 71, 158] : [176, 28, 26],
  ] as [number[], number[], number[]];
  const [a, b, s] = t < 0.5 ? [near, mid, 2 * t] : [mid, far, 2 * t - 1];
  return [0, 1, 2].map((k) => Math.round(a[k]! + s * (b[k]! - a[k]!))) as [number, number, number];
}

export function ReliefPanel({ app }: { app: App }) {
  const state = store.state.value;
  const words = TEXT.relief;
  const picked = store.selected.value;
  const chosen = Math.min(picked?.kind === 'patch' ? picked.index : patch.value, Math.max(0, state.patches.length - 1));
  const name = state.layers.displaced;
  useEffect(() => {
    map.value = null;
    if (!name) return;
    let gone = false;
    void app.ask({ type: 'map', patch: chosen }).then((answer) => {
      if (!gone && answer?.type === 'map') map.value = answer;
    });
    return () => {
      gone = true;
    };
  }, [name, chosen]);
  const units = state.project?.units ?? '';
  if (!name) {
    return (
      <Section title={words.title}>
        <p class="faint">{words.none}</p>
      </Section>
    );
  }
  const now = map.value;
  const scale = now ? usualMost(now.heights) : 1;
  const isInHand = store.tool.value === 'sculpt';
  return (
    <>
      {isInHand && <Brush app={app} />}
      <Section title={words.title}>
        <label class="field">
          {words.patch}
          <input
            type="number"
            min={0}
            max={state.patches.length - 1}
            value={chosen}
            onInput={(e) => {
              patch.value = Math.max(0, Math.round(Number(e.currentTarget.value) || 0));
              store.selected.value = { kind: 'patch', index: Math.min(patch.value, state.patches.length - 1) };
            }}
          />
        </label>
        {now && <Picture map={now} scale={scale} patch={chosen} />}
        {now && (
          <>
            <div class="band" aria-hidden="true">
              <span>
                −{length(scale, units)} {words.below}
              </span>
              <i />
              <span>
                {length(scale, units)} {words.above}
              </span>
            </div>
            <dl>
              <Fact name={words.rms} value={length(now.rms, units)} />
              <Fact name={words.most} value={length(now.most, units)} />
              <Fact name={words.texels} value={`${now.cols} x ${now.rows}`} />
            </dl>
          </>
        )}
        <Slider
          label={words.strength}
          value={store.strength.value}
          min={0}
          max={5}
          step={0.1}
          show={(v) => `${Math.round(100 * v)} %`}
          onInput={(v) => {
            store.strength.value = Math.round(10 * v) / 10;
            store.showShape('displaced');
          }}
        />
      </Section>
      {!isInHand && <Brush app={app} />}
      <Waves app={app} />
    </>
  );
}

const MODES = ['raise', 'engrave', 'smooth', 'erase'] as const;

function Brush({ app }: { app: App }) {
  const { relief_done: done, relief_undone: undone } = store.state.value;
  const { mode } = store.brush.value;
  const words = TEXT.relief;
  const isInHand = store.tool.value === 'sculpt';
  return (
    <Section title={words.brush}>
      {!isInHand && (
        <button type="button" onClick={() => app.choose('sculpt')}>
          {words.take}
        </button>
      )}
      {isInHand && (
        <>
          <Choice
            label={words.mode}
            value={mode}
            options={MODES.map((m) => [m, words[m]] as const)}
            onPick={(m) => {
              store.brush.value = { ...store.brush.value, mode: m };
            }}
          />
          <BrushLength which="radius" />
          {(mode === 'raise' || mode === 'engrave') && <BrushLength which="height" />}
        </>
      )}
      {done.length + undone.length > 0 && (
        <>
          <p class="faint">{words.edits(done.length)}</p>
          <div class="row">
            <button type="button" disabled={done.length === 0} onClick={() => void app.unsculpt()}>
              {words.back}
            </button>
            <button type="button" disabled={undone.length === 0} onClick={() => void app.resculpt()}>
              {words.again}
            </button>
            <button type="button" disabled={done.length === 0} onClick={() => void app.script(true)}>
              {words.script}
            </button>
          </div>
        </>
      )}
    </Section>
  );
}

function BrushLength({ which }: { which: keyof typeof store.BRUSH }) {
  const { project } = store.state.value;
  const { least, most } = store.BRUSH[which];
  return (
    <Slider
      label={TEXT.relief[which]}
      value={store.brush.value[which]}
      min={least}
      max={most}
      step={1}
      show={() => length(store.brushLength(which) * (project?.diagonal ?? 1), project?.units ?? '')}
      onInput={(steps) => store.setBrush(which, steps)}
    />
  );
}

function Waves({ app }: { app: App }) {
  const { longest, project } = store.state.value;
  const words = TEXT.relief;
  const diagonal = project?.diagonal ?? 1;
  const at = (l: number) =>
    WAVELENGTHS.reduce(
      (a, w, k) =>
        Math.abs(Math.log((w * diagonal) / l)) < Math.abs(Math.log((WAVELENGTHS[a]! * diagonal) / l)) ? k : a,
      0,
    );
  return (
    <Section title={words.waves}>
      <Choice
        label={words.waves}
        value={longest === null || longest === undefined ? 'all' : 'short'}
        options={[
          ['all', words.allWaves],
          ['short', words.shorter],
        ]}
        onPick={(which) => {
          store.showShape('displaced');
          void app.relief(which === 'all' ? null : WAVELENGTHS[2]! * diagonal);
        }}
      />
      {longest != null && (
        <Slider
          label={words.wavelength}
          value={draft.value ?? at(longest)}
          min={0}
          max={WAVELENGTHS.length - 1}
          step={1}
          show={(k) => length(WAVELENGTHS[k]! * diagonal, project?.units ?? '')}
          onInput={(k) => {
            draft.value = k;
          }}
          onChange={(k) => {
            draft.value = null;
            void app.relief(WAVELENGTHS[k]! * diagonal);
          }}
        />
      )}
      <p class="faint">{words.note}</p>
    </Section>
  );
}

function Picture(props: { map: DisplacementMap; scale: number; patch: number }) {
  const { cols, rows, heights } = props.map;
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const context = canvas.current?.getContext('2d');
    if (!context) return;
    const image = context.createImageData(cols, rows);
    for (let j = 0; j < rows; j++) {
      for (let i = 0; i < cols; i++) {
        // v = 1 is the upper row.
        const color = tint(heights[(rows - 1 - j) * cols + i]! / Math.max(1e-30, props.scale));
        image.data.set([...color, 255], 4 * (j * cols + i));
      }
    }
    context.putImageData(image, 0, 0);
  }, [heights]);
  return (
    <canvas
      class="map"
      ref={canvas}
      width={cols}
      height={rows}
      role="img"
      aria-label={TEXT.relief.image(props.patch)}
    />
  );
}
