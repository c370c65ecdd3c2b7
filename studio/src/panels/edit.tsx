// The panel of the drawing: what is selected, the network, what is left to put right.
import { signal } from '@preact/signals';
import type { App } from '../app';
import { digits } from '../model/format';
import * as store from '../model/store';
import { PAINT_MODES, TEXT } from '../model/texts';
import type { Fault } from '../protocol/types';
import type { Handles } from '../tools/handles';
import { NextStep } from './bars';
import { CarrySection } from './carry';
import { Choice, Section, Slider } from './parts';
import { HolesSection, MeshSection, PointsSection } from './scan';
import { Selection } from './selection';

const patches = signal(24);
const sharp = signal(40);

export function EditPanel({ app }: { app: App }) {
  const state = store.state.value;
  const hasMesh = Boolean(state.layers.mesh);
  const hasPoints = Boolean(state.layers.points);
  return (
    <>
      <NextStep app={app} patches={patches.value} />
      {!hasMesh && <PointsSection app={app} />}
      {hasPoints && state.curves.length === 0 && <MeshSection app={app} />}
      <ToolOptions app={app} />
      <CarrySection app={app} />
      <Selection app={app} />
      {hasMesh && <HolesSection app={app} />}
      {hasMesh && <Faults app={app} />}
      {hasMesh && <Network app={app} />}
    </>
  );
}

function ToolOptions({ app }: { app: App }) {
  const tool = store.tool.value;
  if (tool === 'paint' || tool === 'feature') {
    const modes = Object.keys(PAINT_MODES) as store.PaintMode[];
    return (
      <Section title={TEXT.paint.title}>
        <Choice
          label={TEXT.paint.label}
          value={store.paintMode.value}
          options={modes.map((m) => [m, PAINT_MODES[m].name] as const)}
          onPick={(value) => {
            store.paintMode.value = value;
          }}
        />
        <p class="faint">{PAINT_MODES[store.paintMode.value].note}</p>
      </Section>
    );
  }
  if (tool === 'drag') {
    return (
      <Section title={TEXT.drag.title}>
        <Slider
          label={TEXT.drag.label}
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
  if (tool === 'hold') return <HoldOptions />;
  if (tool === 'handles') {
    return (
      <Section title={TEXT.handles.title}>
        <Slider
          label={TEXT.handles.count}
          value={store.handleCount.value}
          min={4}
          max={40}
          step={1}
          show={String}
          onInput={(v) => {
            store.handleCount.value = v;
          }}
          onChange={() => void (app.tools.handles as Handles).ask()}
        />
      </Section>
    );
  }
  return null;
}

/** Stiffness of the brush: steps of about three. */
const STIFFNESSES = [0.1, 0.3, 1, 3, 10, 30, 100];

function HoldOptions() {
  const holds = store.holds.value;
  const words = TEXT.hold;
  return (
    <Section title={words.title}>
      <Slider
        label={words.brush}
        value={STIFFNESSES.indexOf(store.stiffness.value)}
        min={0}
        max={STIFFNESSES.length - 1}
        step={1}
        show={(k) => (STIFFNESSES[k] === 1 ? words.none : words.times(digits(STIFFNESSES[k]!)))}
        onInput={(k) => {
          store.stiffness.value = STIFFNESSES[k]!;
        }}
      />
      {holds && (
        <>
          <p class="faint">{words.found(holds.pins.length, holds.stretches.length)}</p>
          <button
            type="button"
            onClick={() => {
              store.holds.value = null;
            }}
          >
            {words.clear}
          </button>
        </>
      )}
    </Section>
  );
}

function Faults({ app }: { app: App }) {
  const { faults, curves } = store.state.value;
  const words = TEXT.faults;
  if (faults.length === 0 || curves.length === 0) return null;
  const mend = (fault: Fault) => {
    const at = fault.why.place;
    if (fault.offer === 'boundaries') void app.edit({ edit: 'boundaries' });
    if (fault.offer === 'split_region' && at) void app.edit({ edit: 'split_region', at });
    if (fault.offer === 'delete_corner' && at) void app.edit({ edit: 'delete_corner', corner: { near: at } });
  };
  const word = { boundaries: words.draw, split_region: words.split, delete_corner: words.remove };
  return (
    <Section title={words.title(faults.length)}>
      <ul class="faults">
        {faults.slice(0, 8).map((fault) => (
          <li key={fault.why.message}>
            <p>{capital(short(fault.why.message))}</p>
            {fault.why.hint && <p class="faint">{capital(fault.why.hint)}</p>}
            <div class="row">
              {fault.why.place && (
                <button type="button" class="small" onClick={() => app.fly(fault.why.place!)}>
                  {words.show}
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
      {faults.length > 8 && <p class="faint">{words.more(faults.length - 8)}</p>}
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
  const words = TEXT.network;
  const has = state.curves.length > 0;
  const finished = state.patches.length > 0 && state.faults.length === 0;
  return (
    <Section title={words.title}>
      <Slider
        label={words.patches}
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
            {has ? words.complete : words.layOut}
          </button>
        )}
        {has && (
          <button type="button" onClick={() => void app.edit({ edit: 'relax' })}>
            {words.relax}
          </button>
        )}
      </div>
      <Slider
        label={words.sharp}
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
          {words.drawSharp}
        </button>
        <button type="button" onClick={() => void app.edit({ edit: 'boundaries' })}>
          {words.boundaries}
        </button>
      </div>
      <div class="row">
        <button type="button" onClick={() => void app.edit({ edit: 'symmetry' })}>
          {words.symmetry}
        </button>
        {state.symmetry && has && (
          <>
            <button type="button" onClick={() => void app.edit({ edit: 'mirror' })}>
              {words.mirror}
            </button>
            <button type="button" onClick={() => void app.edit({ edit: 'mirror', swap: true })}>
              {words.mirrorBack}
            </button>
          </>
        )}
        {has && (
          <button type="button" onClick={() => void app.edit({ edit: 'clear' })}>
            {words.clear}
          </button>
        )}
      </div>
    </Section>
  );
}
