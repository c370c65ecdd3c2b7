// Small parts that panels are made of.
import type { ComponentChildren } from 'preact';

export function Section({ title, children }: { title: string; children: ComponentChildren }) {
  return (
    <section class="section">
      <h2>{title}</h2>
      {children}
    </section>
  );
}

export function Choice<T extends string>(props: {
  label: string;
  value: T;
  options: readonly (readonly [T, string])[];
  onPick: (value: T) => void;
}) {
  return (
    <div class={props.options.length > 4 ? 'choice many' : 'choice'} role="radiogroup" aria-label={props.label}>
      {props.options.map(([value, name]) => (
        // biome-ignore lint/a11y/useSemanticElements: a row of buttons, one of them on
        <button
          type="button"
          key={value}
          role="radio"
          aria-checked={props.value === value}
          class={props.value === value ? 'on' : ''}
          onClick={() => props.onPick(value)}
        >
          {name}
        </button>
      ))}
    </div>
  );
}

export function Slider(props: {
  label: string;
  value: number;
  min: number;
  max: number;
  step: number;
  show: (value: number) => string;
  onInput: (value: number) => void;
  onChange?: (value: number) => void;
}) {
  return (
    <label class="slider">
      <span>{props.label}</span>
      <output>{props.show(props.value)}</output>
      <input
        type="range"
        aria-label={props.label}
        min={props.min}
        max={props.max}
        step={props.step}
        value={props.value}
        onInput={(e) => props.onInput(Number(e.currentTarget.value))}
        onChange={(e) => props.onChange?.(Number(e.currentTarget.value))}
      />
    </label>
  );
}

export function Check(props: { label: string; value: boolean; onPick: (value: boolean) => void; disabled?: boolean }) {
  return (
    <label class="check">
      <input
        type="checkbox"
        checked={props.value}
        disabled={props.disabled ?? false}
        onChange={(e) => props.onPick(e.currentTarget.checked)}
      />
      {props.label}
    </label>
  );
}

export function Fact({ name, value }: { name: string; value: string }) {
  return (
    <div class="fact">
      <dt>{name}</dt>
      <dd>{value}</dd>
    </div>
  );
}
