// The page: panels around the view.
import { effect } from '@preact/signals';
import { render } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { Vector3 } from 'three';
import { App } from './app';
import { listen } from './input';
import { digits, length } from './model/format';
import * as store from './model/store';
import { TABS, TEXT } from './model/texts';
import { StatusBar, ToolBar, TopBar } from './panels/bars';
import { EditPanel } from './panels/edit';
import { HistoryPanel, ViewPanel } from './panels/look';
import { Connection, Keys, Palette, Toasts } from './panels/overlays';
import { ReliefPanel } from './panels/relief';
import { Start } from './panels/start';
import { SurfacePanel } from './panels/surface';
import { View } from './view/view';
import './style.css';
import './panels.css';

const TAB_LIST = Object.entries(TABS) as [store.Tab, string][];

function Side({ app }: { app: App }) {
  const tab = store.tab.value;
  return (
    <aside class="side" aria-label={TEXT.panels}>
      <div class="tabs" role="tablist">
        {TAB_LIST.map(([id, name]) => (
          <button
            type="button"
            key={id}
            role="tab"
            id={`tab-${id}`}
            aria-selected={tab === id}
            aria-controls="panel"
            class={tab === id ? 'on' : ''}
            onClick={() => {
              store.tab.value = id;
            }}
          >
            {name}
          </button>
        ))}
      </div>
      {/* biome-ignore lint/a11y/noNoninteractiveTabindex: a panel that scrolls can be reached by keys */}
      <div class="panel" role="tabpanel" id="panel" aria-labelledby={`tab-${tab}`} tabIndex={0}>
        {tab === 'edit' && <EditPanel app={app} />}
        {tab === 'surface' && <SurfacePanel app={app} />}
        {tab === 'relief' && <ReliefPanel app={app} />}
        {tab === 'view' && <ViewPanel app={app} />}
        {tab === 'history' && <HistoryPanel app={app} />}
      </div>
    </aside>
  );
}

function Legend() {
  const how = store.shading.value;
  if (store.shape.value === 'points' || (how !== 'deviation' && how !== 'curvature')) return null;
  const most = store.scaleFound.value;
  const units = store.state.value.project?.units ?? '';
  const unit = how === 'deviation' ? units : `1/${units}`;
  return (
    <div class="legend">
      <span>{length(most, unit)}</span>
      <i aria-hidden="true" />
      <span>0</span>
      <i class="low" aria-hidden="true" />
      <span>−{length(most, unit)}</span>
      <strong>{how === 'deviation' ? TEXT.legend.deviation : TEXT.legend.curvature}</strong>
    </div>
  );
}

/** Colours of the angles of seams. */
function Angles() {
  if (!store.show.value.angles || store.state.value.seams.length === 0) return null;
  return (
    <div class="angles">
      <strong>{TEXT.legend.angles}</strong>
      <span>0°</span>
      <i aria-hidden="true" />
      <span>{digits(store.largestAngle.value)}°</span>
      <i class="sharp" aria-hidden="true" />
      <span>{TEXT.legend.sharp}</span>
    </div>
  );
}

let app: App | null = null;

function Page() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const over = useRef<HTMLCanvasElement>(null);
  const ready = store.connection.value === 'open' || store.state.value.project !== null;
  useEffect(() => {
    const shown = canvas.current;
    if (!shown || !over.current) return;
    const view = new View(shown, over.current);
    app = new App(view, location.hash.slice(1));
    const fit = () => view.resize(shown.parentElement!.clientWidth, shown.parentElement!.clientHeight);
    new ResizeObserver(fit).observe(shown.parentElement!);
    listen(app, shown);
    takeDrops(app);
    expose(app);
    app.client.connect();
    effect(() => {
      shown.style.cursor = app?.tools[store.tool.value].cursor ?? 'default';
    });
    // The panels are drawn once there is something to bind them to.
    store.connection.value = 'connecting';
    redraw();
  }, []);
  const project = store.state.value.project;
  const bound = app;
  return (
    <div class={project ? 'page' : 'page empty'}>
      {bound && <TopBar app={bound} />}
      {bound && project && <ToolBar app={bound} />}
      <div class="stage-view">
        <canvas ref={canvas} tabIndex={0} aria-label={TEXT.view} />
        <canvas ref={over} class="over" />
        {project && <Legend />}
        {project && <Angles />}
      </div>
      {bound && project && <Side app={bound} />}
      {bound && project && <StatusBar app={bound} />}
      {bound && !project && ready && <Start app={bound} />}
      {bound && <Toasts app={bound} />}
      {store.overlay.value === 'keys' && <Keys />}
      {bound && store.overlay.value === 'palette' && <Palette app={bound} />}
      <Connection />
    </div>
  );
}

/** Files may be dropped anywhere. */
function takeDrops(bound: App): void {
  window.addEventListener('dragover', (e) => e.preventDefault());
  window.addEventListener('drop', (e) => {
    e.preventDefault();
    const file = e.dataTransfer?.files[0];
    if (file) void bound.drop(file);
  });
}

/** For tests: what the page would tell a person. */
function expose(bound: App): void {
  Object.assign(window, {
    __studio: {
      idle: () => bound.isIdle(),
      shown: () => bound.isShown(),
      state: () => store.state.value,
      project: (p: number[]) => {
        const c = store.state.value.project?.center ?? [0, 0, 0];
        return bound.view.project(new Vector3(p[0]! - c[0], p[1]! - c[1], p[2]! - c[2]));
      },
      pick: (x: number, y: number) => {
        const hit = bound.view.pick(x, y);
        return hit ? bound.world(hit.place) : null;
      },
      // Nothing while the curves on the screen are those of an earlier state.
      curve: (k: number) => {
        const { position, offset } = bound.view.curves;
        if (!store.areCurvesOfNow.value || k + 1 >= offset.length) return null;
        return Array.from(position.subarray(3 * offset[k]!, 3 * offset[k + 1]!));
      },
      frames: () => bound.view.drawn,
      app: bound,
      store,
    },
  });
}

const root = document.getElementById('app')!;
function redraw(): void {
  render(<Page />, root);
}

store.dark.value =
  localStorage.getItem('dark') === 'yes' ||
  (localStorage.getItem('dark') === null && matchMedia('(prefers-color-scheme: dark)').matches);
effect(() => {
  document.documentElement.dataset.theme = store.dark.value ? 'dark' : 'light';
  localStorage.setItem('dark', store.dark.value ? 'yes' : 'no');
});
redraw();
