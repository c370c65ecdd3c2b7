// The bar on top with the stages, the tools on the left, the line below.
import type { App } from '../app';
import { count, digits } from '../model/format';
import { next } from '../model/next';
import * as store from '../model/store';
import { STAGES, STANDING, TEXT, TOOLS } from '../model/texts';
import { Icon } from './icons';

export function TopBar({ app }: { app: App }) {
  const state = store.state.value;
  const { project } = state;
  const saved = !project
    ? ''
    : project.unsaved
      ? TEXT.top.unsaved(project.unsaved)
      : project.saved
        ? TEXT.top.saved
        : TEXT.top.saving;
  return (
    <header class="top">
      <div class="brand">
        <span class="mark" aria-hidden="true" />
        {TEXT.brand}
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
              disabled={store.history.value[0] === 0}
              title={TEXT.top.undoTip}
              aria-label={TEXT.top.undo}
            >
              <Icon name="undo" />
            </button>
            <button
              type="button"
              class="flat"
              onClick={app.redo}
              disabled={store.history.value[1] === 0}
              title={TEXT.top.redoTip}
              aria-label={TEXT.top.redo}
            >
              <Icon name="redo" />
            </button>
            <button
              type="button"
              class="flat"
              onClick={() => app.picture()}
              title={TEXT.top.picture}
              aria-label={TEXT.top.picture}
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
          title={TEXT.top.commandsTip}
          aria-label={TEXT.top.commands}
        >
          <Icon name="command" />
        </button>
        <button
          type="button"
          class="flat"
          onClick={() => {
            store.dark.value = !store.dark.value;
          }}
          title={store.dark.value ? TEXT.top.light : TEXT.top.dark}
          aria-label={store.dark.value ? TEXT.top.lightColours : TEXT.top.darkColours}
        >
          <Icon name={store.dark.value ? 'sun' : 'moon'} />
        </button>
        <button
          type="button"
          class="flat"
          onClick={() => {
            store.overlay.value = 'keys';
          }}
          title={TEXT.top.keysTip}
          aria-label={TEXT.top.keys}
        >
          <Icon name="help" />
        </button>
        {project && (
          <button
            type="button"
            class="flat"
            onClick={() => void app.close()}
            title={TEXT.top.away}
            aria-label={TEXT.top.away}
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
    <nav class="strip" aria-label={TEXT.top.stages}>
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
  const state = store.state.value;
  const offered = TOOLS.filter((t) => store.canUse(t.id, state));
  return (
    <div class="tools" role="toolbar" aria-label={TEXT.top.tools} aria-orientation="vertical">
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
        aria-label={TEXT.top.fit}
        data-tip={TEXT.top.fitTip}
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
            {TEXT.status.stop}
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
            ? TEXT.status.triangles(count(state.project.triangles))
            : TEXT.status.points(count(state.project.points))}
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
    <section class="next" aria-label={TEXT.next.label}>
      <p>{step.text}</p>
      {step.action && (
        <button type="button" class="primary" onClick={go}>
          {step.action}
        </button>
      )}
    </section>
  );
}
