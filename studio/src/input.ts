// Mouse, wheel, touchpad and keyboard to the view and the tool.
import type { App } from './app';
import * as store from './model/store';
import { TOOLS } from './model/texts';
import type { Spot } from './tools/tool';
import type { ViewName } from './view/rig';
import { cornerAt, curveAt } from './view/seek';

/** A drag begins after so many pixels; less is a click. */
const DRAG_PIXELS = 4;
/** Zoom per step of the wheel. */
const ZOOM_PER_WHEEL_STEP = 0.0012;
const VIEWS: ViewName[] = ['front', 'back', 'right', 'left', 'top', 'bottom'];

function spotAt(app: App, event: { offsetX: number; offsetY: number }): Spot {
  const [x, y] = [event.offsetX, event.offsetY];
  const { view } = app;
  const state = store.state.value;
  const lines = store.show.value.curves;
  // Until the curves of an edit are there, numbers of the old ones would name others.
  const curves = lines && store.areCurvesOfNow.value;
  return once<Spot>({
    x: () => x,
    y: () => y,
    place: () => view.pick(x, y)?.place ?? null,
    corner: () => (lines ? cornerAt(view, state, x, y) : null),
    curve: () => (curves ? (curveAt(view, x, y) ?? curveAt(view, x, y, 'feature')) : null),
  });
}

/** Values that are looked for when they are asked for, once: a drag seeks no curve. */
function once<T extends object>(found: { [K in keyof T]: () => T[K] }): T {
  const values = {} as T;
  for (const name of Object.keys(found) as (keyof T)[]) {
    Object.defineProperty(values, name, {
      configurable: true,
      enumerable: true,
      get() {
        const value = found[name]();
        Object.defineProperty(values, name, { value, enumerable: true });
        return value;
      },
    });
  }
  return values;
}

export function listen(app: App, canvas: HTMLCanvasElement): void {
  const { view } = app;
  let down: { x: number; y: number; button: number; has: boolean; moved: boolean } | null = null;
  let last = { x: 0, y: 0 };
  let moveQueued = false;

  canvas.addEventListener('contextmenu', (e) => e.preventDefault());
  canvas.addEventListener('pointerdown', (e) => {
    canvas.focus();
    canvas.setPointerCapture(e.pointerId);
    const spot = spotAt(app, e);
    const has = e.button === 0 && !e.altKey && store.state.value.project !== null && (app.tool().down?.(spot) ?? false);
    down = { x: e.offsetX, y: e.offsetY, button: e.button, has, moved: false };
    last = { x: e.offsetX, y: e.offsetY };
  });
  canvas.addEventListener('pointermove', (e) => {
    const [dx, dy] = [e.offsetX - last.x, e.offsetY - last.y];
    if (down) {
      down.moved ||= Math.hypot(e.offsetX - down.x, e.offsetY - down.y) > DRAG_PIXELS;
      if (!down.moved) return;
      last = { x: e.offsetX, y: e.offsetY };
      if (down.has) return app.tool().drag?.(spotAt(app, e));
      const height = canvas.clientHeight;
      if (down.button === 0 && !e.shiftKey) view.rig.orbit(dx / height, dy / height, store.orbit.value);
      else view.rig.pan(dx / height, dy / height);
      return view.moved();
    }
    last = { x: e.offsetX, y: e.offsetY };
    if (moveQueued || !store.state.value.project) return;
    moveQueued = true;
    requestAnimationFrame(() => {
      moveQueued = false;
      if (down) return;
      const spot = spotAt(app, { offsetX: last.x, offsetY: last.y });
      store.cursor.value = spot.place ? app.world(spot.place) : null;
      app.tool().move?.(spot);
    });
  });
  canvas.addEventListener('pointerup', (e) => {
    const was = down;
    down = null;
    if (!was) return;
    if (was.has) {
      if (was.moved) app.tool().up?.(spotAt(app, e));
      else app.tool().leave?.();
    }
    if (!was.moved && was.button === 0 && store.state.value.project) app.tool().click?.(spotAt(app, e));
  });
  canvas.addEventListener('pointercancel', () => {
    down = null;
    app.tool().leave?.();
  });
  canvas.addEventListener('dblclick', () => app.tool().doubleClick?.());
  canvas.addEventListener('pointerleave', () => {
    store.cursor.value = null;
  });
  canvas.addEventListener(
    'wheel',
    (e) => {
      e.preventDefault();
      const anchor = view.pick(e.offsetX, e.offsetY)?.place;
      // Pinching on a touchpad comes as a wheel with Ctrl, in small steps.
      view.rig.zoom(Math.exp(e.deltaY * ZOOM_PER_WHEEL_STEP * (e.ctrlKey ? 6 : 1)), anchor);
      view.moved();
    },
    { passive: false },
  );
  window.addEventListener('keydown', (e) => {
    if (key(app, e)) e.preventDefault();
  });
}

function key(app: App, e: KeyboardEvent): boolean {
  const target = e.target as HTMLElement;
  const typing = target.matches('input:not([type=range]):not([type=checkbox]):not([type=radio]), select, textarea');
  const control = e.ctrlKey || e.metaKey;
  if (control && e.key.toLowerCase() === 'k') {
    store.overlay.value = store.overlay.value === 'palette' ? 'none' : 'palette';
    return true;
  }
  if (e.key === 'Escape' && store.overlay.value !== 'none') {
    store.overlay.value = 'none';
    return true;
  }
  if (typing || store.overlay.value !== 'none') return false;
  if (control) {
    if (e.key.toLowerCase() === 'z') void (e.shiftKey ? app.redo() : app.undo());
    else if (e.key.toLowerCase() === 'y') void app.redo();
    else return false;
    return true;
  }
  if (e.altKey) return false;
  if (e.key === '?') {
    store.overlay.value = 'keys';
    return true;
  }
  if (!store.state.value.project) return false;
  // Enter on a button presses it.
  if (!(e.key === 'Enter' && target.matches('button')) && app.tool().key?.(e.key)) return true;
  return command(app, e, target);
}

function command(app: App, e: KeyboardEvent, target: HTMLElement): boolean {
  const { rig } = app.view;
  const tool = TOOLS.find((t) => t.key.toLowerCase() === e.key.toLowerCase());
  const free = !target.matches('input, [role=tab], button') || target === app.view.canvas;
  const turn = (dx: number, dy: number) => {
    rig.orbit(dx, dy, store.orbit.value);
    app.view.moved();
  };
  if (tool) {
    if (store.canUse(tool.id, store.state.value)) app.choose(tool.id);
  } else if (e.key === 'Escape') app.choose('select');
  else if (e.key === 'Delete') app.remove();
  else if (e.key === 'Home') app.home();
  else if (/^[1-6]$/.test(e.key)) {
    rig.look(VIEWS[Number(e.key) - 1]!);
    app.view.moved();
  } else if (e.key.toLowerCase() === 'o') store.parallel.value = !store.parallel.value;
  else if (e.key === '+' || e.key === '-') {
    rig.zoom(e.key === '+' ? 0.8 : 1.25);
    app.view.moved();
  } else if (free && e.key === 'ArrowLeft') turn(-0.05, 0);
  else if (free && e.key === 'ArrowRight') turn(0.05, 0);
  else if (free && e.key === 'ArrowUp') turn(0, -0.05);
  else if (free && e.key === 'ArrowDown') turn(0, 0.05);
  else return false;
  return true;
}
