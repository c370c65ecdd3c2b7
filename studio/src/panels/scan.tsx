// The panel of the points: what is known of them, which are left out, the mesh to be made; and holes of the mesh.
import { signal } from '@preact/signals';
import type { App } from '../app';
import { count, digits, length } from '../model/format';
import * as store from '../model/store';
import { POINT_COLORS, TEXT } from '../model/texts';
import { colorsOf } from '../view/cloud';
import { Choice, Fact, Section } from './parts';

const voxel = signal('');

export function PointsSection({ app }: { app: App }) {
  const { cleaned, left_out, project } = store.state.value;
  const words = TEXT.scan;
  const units = project?.units ?? '';
  const colors = colorsOf(store.geometry.value.get('points'));
  return (
    <Section title={words.title}>
      {cleaned ? (
        <dl>
          <Fact name={words.noise} value={length(cleaned.noise, units)} />
          <Fact name={words.spacing} value={length(cleaned.spacing, units)} />
          <Fact name={words.outliers} value={count(cleaned.outliers)} />
          <Fact name={words.parts} value={count(cleaned.parts)} />
        </dl>
      ) : (
        <>
          <p class="faint">{words.note}</p>
          <button type="button" onClick={() => void app.clean()}>
            {words.look}
          </button>
        </>
      )}
      {colors.length > 1 && (
        <Choice
          label={words.color}
          value={store.pointColor.value}
          options={colors.map((c) => [c, POINT_COLORS[c]] as const)}
          onPick={(c) => {
            store.pointColor.value = c;
            store.showShape('points');
          }}
        />
      )}
      {store.tool.value === 'lasso' && (
        <Choice
          label={words.lasso}
          value={store.lassoOutside.value ? 'outside' : 'inside'}
          options={[
            ['inside', words.inside],
            ['outside', words.outside],
          ]}
          onPick={(v) => {
            store.lassoOutside.value = v === 'outside';
          }}
        />
      )}
      {left_out > 0 && (
        <>
          <p class="faint">{words.leftOut(count(left_out))}</p>
          <div class="row">
            <button type="button" onClick={() => void app.undo()}>
              {words.back}
            </button>
            <button type="button" onClick={() => void app.back(store.state.value.done.length)}>
              {words.all}
            </button>
          </div>
        </>
      )}
    </Section>
  );
}

export function MeshSection({ app }: { app: App }) {
  const { cleaned, project } = store.state.value;
  const words = TEXT.scan;
  const edge = Number(voxel.value);
  const chosen = voxel.value !== '' && edge > 0 ? edge : undefined;
  return (
    <Section title={words.mesh}>
      <label class="field">
        {words.voxel}, {project?.units}
        <input
          type="number"
          min={0}
          step="any"
          value={voxel.value}
          placeholder={cleaned ? digits(cleaned.voxel) : words.usual}
          onInput={(e) => {
            voxel.value = e.currentTarget.value;
          }}
        />
      </label>
      <div class="row">
        <button type="button" onClick={() => void app.mesh(true, chosen)}>
          {words.close}
        </button>
        <button type="button" onClick={() => void app.mesh(false, chosen)}>
          {words.open}
        </button>
      </div>
    </Section>
  );
}

export function HolesSection({ app }: { app: App }) {
  const { holes, project } = store.state.value;
  if (holes.length === 0) return null;
  const words = TEXT.holes;
  return (
    <Section title={words.title(holes.length)}>
      <p class="faint">{words.note}</p>
      <ul class="list">
        {holes.map((hole, k) => (
          <li key={hole.place.join()}>
            <span>{words.around(length(hole.around, project?.units ?? ''))}</span>
            <span class="row">
              <button type="button" class="small" onClick={() => app.fly(hole.place)}>
                {words.show}
              </button>
              <button type="button" class="small" onClick={() => void app.closeHole(k)}>
                {words.close}
              </button>
            </span>
          </li>
        ))}
      </ul>
    </Section>
  );
}
