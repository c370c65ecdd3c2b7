// The bar on top with the stages, the tools on the left, the line below.
import type { App } from '../app';
import { count, digits } from '../model/format';
import { next } from '../model/next';
import * as store from '../model/store';
import { STAGES, STANDING, TOOLS } from '../model/texts';
import { Icon } from './icons';

export function TopBar({ app }: { app: App }) {
  const state = store.state.value;
  const { project } = state;
  const saved = !project
    ? ''
    : project.unsaved
      ? `Not saved: ${project.unsaved}`
      : project.triangles === 0
        ? 'Saved once there is a mesh'
        : project.saved
          ? 'Saved'
          : 'Saving ...';
  return (
    <header class="top">
      <div class="brand">
        <span class="mark" aria-hidden="true" />
        planish
      </div>
      {project && (
        <div class="project">
          <strong title={project.file}>{project.name}</strong>
          <span class={project.unsaved ? 'bad' : 'faint'} title={project.file}>
            {saved}
          </span>
        </div>
      )}
      {project && <Strip />}
      <div class="actions">
        {project && (
          <>
            <button
              type="button"
              class="flat"
              onClick={app.undo}
              disabled={state.done.length === 0}
              title="Undo (Ctrl Z)"
              aria-label="Undo"
            >
              <Icon name="undo" />
            </button>
            <button
              type="button"
              class="flat"
              onClick={app.redo}
              disabled={state.undone.length === 0}
              title="Redo (Ctrl Shift Z)"
              aria-label="Redo"
            >
              <Icon name="redo" />
            </button>
            <button
              type="button"
              class="flat"
              onClick={() => app.picture()}
              title="Save a picture"
              aria-label="Save a picture"
            >
              <Icon name="camera" />
            </button>
          </>
        )}
        <button
          type="button"
          class="flat"
          onClick={() => {
            store.overlay.value = 'palette';
          }}
          title="All commands (Ctrl K)"
          aria-label="All commands"
        >
          <Icon name="command" />
        </button>
        <button
          type="button"
          class="flat"
          onClick={() => {
            store.dark.value = !store.dark.value;
          }}
          title={store.dark.value ? 'Light' : 'Dark'}
          aria-label={store.dark.value ? 'Light colours' : 'Dark colours'}
        >
          <Icon name={store.dark.value ? 'sun' : 'moon'} />
        </button>
        <button
          type="button"
          class="flat"
          onClick={() => {
            store.overlay.value = 'keys';
          }}
          title="Keys (?)"
          aria-label="Keys"
        >
          <Icon name="help" />
        </button>
        {project && (
          <button
            type="button"
            class="flat"
            onClick={() => void app.close()}
            title="Put the project away"
            aria-label="Put the project away"
          >
            <Icon name="close" />
          </button>
        )}
      </div>
    </header>
  );
}

/** A click on a stage shows what it made. */
function look(name: string): void {
  const { layers } = store.state.value;
  if (name === 'scan' && layers.points) store.showShape('points');
  if ((name === 'mesh' || name === 'curves' || name === 'patches') && layers.mesh) store.showShape('mesh');
  if (name === 'surfaces' && layers.surfaces) store.showShape('surfaces');
}

function Strip() {
  const { stages } = store.state.value;
  return (
    <nav class="strip" aria-label="Stages">
      {stages
        .filter((s) => s.name !== 'scan' || s.is !== 'empty')
        .map((s) => (
          <button
            type="button"
            key={s.name}
            class={`stage ${s.is}`}
            onClick={() => look(s.name)}
            title={`${STAGES[s.name]}: ${STANDING[s.is]}${s.is === 'failed' ? ` - ${s.note}` : `, ${s.note}`}`}
          >
            <span class="dot" aria-hidden="true" />
            {STAGES[s.name]}
            <span class="sr">, {STANDING[s.is]}</span>
          </button>
        ))}
    </nav>
  );
}

export function ToolBar({ app }: { app: App }) {
  const { layers } = store.state.value;
  const hasPatches = store.state.value.patches.length > 0;
  const offered = TOOLS.filter((t) => {
    if (t.id === 'select') return true;
    if (!layers.mesh) return false;
    return t.id === 'feature' ? hasPatches : true;
  });
  return (
    <div class="tools" role="toolbar" aria-label="Tools" aria-orientation="vertical">
      {offered.map((t) => (
        <button
          type="button"
          key={t.id}
          class={store.tool.value === t.id ? 'tool on' : 'tool'}
          aria-pressed={store.tool.value === t.id}
          aria-label={t.name}
          onClick={() => app.choose(t.id)}
          data-tip={`${t.name}  ${t.key}`}
        >
          <Icon name={t.id} />
        </button>
      ))}
      <span class="gap" />
      <button
        type="button"
        class="tool"
        aria-label="Fit the view"
        data-tip="Fit the view  Home"
        onClick={() => app.home()}
      >
        <Icon name="home" />
      </button>
    </div>
  );
}

export function StatusBar({ app }: { app: App }) {
  const state = store.state.value;
  const tool = TOOLS.find((t) => t.id === store.tool.value)!;
  const at = store.cursor.value;
  const job = store.jobs.value[0];
  return (
    <footer class="status">
      <span class="hint" role="status">
        {state.project && (store.toolHint.value || tool.hint)}
      </span>
      {job && (
        <span class="job">
          {job.title}
          {job.stage && `: ${job.stage}`}
          <progress max={1} value={job.fraction} aria-label={job.title} />
          <span class="number">{Math.round(100 * job.fraction)} %</span>
          <button type="button" class="small" onClick={() => void app.cancel(job.job)}>
            Stop
          </button>
        </span>
      )}
      {at && (
        <span class="number faint">
          {at.map((x) => digits(x)).join('  ')} {state.project?.units}
        </span>
      )}
      {state.project && (
        <span class="number faint">
          {state.project.triangles > 0
            ? `${count(state.project.triangles)} triangles`
            : `${count(state.project.points)} points`}
        </span>
      )}
    </footer>
  );
}

/** The next useful step, with its button. */
export function NextStep({ app, patches }: { app: App; patches: number }) {
  const step = next({ ...store.state.value, jobs: store.jobs.value });
  const go = () => {
    if (step.step === 'mesh') void app.mesh();
    if (step.step === 'draw' || step.step === 'mend') void app.complete(patches, 40);
    if (step.step === 'fit') void app.fit();
    if (step.step === 'export') void app.export('step');
  };
  return (
    <section class="next" aria-label="Next step">
      <p>{step.text}</p>
      {step.action && (
        <button type="button" class="primary" onClick={go}>
          {step.action}
        </button>
      )}
    </section>
  );
}
