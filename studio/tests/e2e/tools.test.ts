// Every tool and panel by mouse and keys, with a picture of each; and a session that is saved and replayed. Each test has a
// program and a folder of its own: none stands on what another has left.
import { spawnSync } from 'node:child_process';
import { copyFileSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import { chromiumPath, PROGRAM, Program, SHOTS, Studio, withBrowser } from './harness';
import { scan, sphere, square } from './shapes';

const TOUR = join(import.meta.dirname, '../../../docs/guide/studio-tour.toml');

/** What the page does for a hand, asked for at once. */
async function edit(studio: Studio, edit: object): Promise<void> {
  const done = await studio.page.evaluate(
    (e) => (window as never as { __studio: { app: { edit(e: object): Promise<boolean> } } }).__studio.app.edit(e),
    edit,
  );
  expect(done, JSON.stringify(edit)).toBe(true);
}

const middleOf = (course: number[]) => {
  const k = 3 * Math.floor(course.length / 6);
  return course.slice(k, k + 3);
};

describe.skipIf(!chromiumPath)('tools', () => {
  withBrowser();
  const { corners, middle } = square();
  let program: Program;

  beforeEach(() => {
    program = new Program();
  });
  afterEach(async () => {
    await program.end();
    program.remove();
  });

  /** A page on a ball. */
  async function ball(): Promise<Studio> {
    writeFileSync(join(program.folder, 'ball.obj'), sphere(40));
    const studio = await Studio.open(await program.start('ball.obj'));
    await studio.until((s) => s.layers.mesh !== undefined);
    return studio;
  }

  /** A page on a ball with four curves that make two patches. */
  async function four(): Promise<Studio> {
    const studio = await ball();
    for (let k = 0; k < 4; k++) await edit(studio, { edit: 'paint', picks: [corners[k], corners[(k + 1) % 4]] });
    await studio.until((s) => s.stages.find((x) => x.name === 'surfaces')?.is === 'fresh');
    await studio.idle();
    return studio;
  }

  it('pin a curve and make a stretch of it stiff; a drag keeps to them', async () => {
    const studio = await four();
    const { page } = studio;
    await page.keyboard.press('h');
    const course = await studio.curve(0);
    const n = course.length / 3;
    const at = (share: number) => {
      const k = 3 * Math.round(share * (n - 1));
      return course.slice(k, k + 3);
    };
    await studio.click(at(0.75));
    const [a, b] = [await studio.pixel(at(0.15)), await studio.pixel(at(0.4))];
    await studio.drag(a, b, 12);
    await page.getByText('1 pin, 1 stretch of its own.').waitFor();
    await studio.idle();
    await studio.shot('hold');
    await page.keyboard.press('d');
    const from = await studio.pixel(at(0.5));
    const to = await studio.pixel(middle);
    await studio.drag(from, { x: from.x + 0.3 * (to.x - from.x), y: from.y + 0.3 * (to.y - from.y) }, 10);
    const state = await studio.until((s) => s.done.length === 5);
    expect(state.done[4]!.edit).toBe('drag_curve');
    await studio.idle();
    const after = await studio.curve(0);
    const nearest = (p: number[]) => {
      let least = Infinity;
      for (let k = 0; k < after.length; k += 3) {
        least = Math.min(least, Math.hypot(after[k]! - p[0]!, after[k + 1]! - p[1]!, after[k + 2]! - p[2]!));
      }
      return least;
    };
    expect(nearest(at(0.75))).toBeLessThan(0.03);
    expect(nearest(at(0.5))).toBeGreaterThan(0.05);
    await page.keyboard.press('Control+z');
    await studio.until((s) => s.done.length === 4);
    await studio.idle();
    await studio.close();
  });

  it('drag a handle of a spline; the curve follows', async () => {
    const studio = await four();
    const { page } = studio;
    await page.keyboard.press('b');
    const before = middleOf(await studio.curve(1));
    await studio.click(before);
    await page.getByText('Drag a handle').waitFor();
    const handle = await page.evaluate(
      () =>
        (
          window as never as {
            __studio: { app: { tools: { handles: { points: { x: number; y: number; z: number }[] } } } };
          }
        ).__studio.app.tools.handles.points[4]!,
    );
    const from = await studio.pixel([handle.x, handle.y, handle.z]);
    const to = await studio.pixel(middle);
    await page.mouse.move(from.x, from.y);
    await page.mouse.down();
    await page.mouse.move(from.x + 0.3 * (to.x - from.x), from.y + 0.3 * (to.y - from.y), { steps: 8 });
    await studio.seen('preview');
    await studio.idle();
    await studio.shot('handles');
    await page.mouse.up();
    const state = await studio.until((s) => s.done.length === 5);
    expect(state.done[4]!.edit).toBe('spline');
    await studio.idle();
    const after = middleOf(await studio.curve(1));
    expect(Math.hypot(...after.map((x, k) => x - before[k]!))).toBeGreaterThan(0.02);
    await studio.close();
  });

  it('paint magnetically, add corners, split, paint a feature curve, measure, and delete', async () => {
    const studio = await four();
    const { page } = studio;
    await page.keyboard.press('m');
    await studio.click(corners[0]!);
    await studio.click(corners[2]!);
    await page.getByText(/^Distance/).waitFor();
    await studio.shot('measure');
    await page.keyboard.press('f');
    const [c0, c2] = [middleOf(await studio.curve(0)), middleOf(await studio.curve(2))];
    await studio.click(c0);
    await studio.click(middle);
    await studio.click(c2);
    await page.keyboard.press('Enter');
    await studio.until((s) => s.features.length === 1);
    await studio.idle();
    await studio.shot('feature');
    await page.keyboard.press('Control+z');
    await studio.until((s) => s.features.length === 0);
    // A corner on a side makes a region of five, which is split.
    await page.keyboard.press('k');
    await studio.click(c0);
    await studio.until((s) => s.corners.length === 5 && s.faults.length > 0);
    await studio.idle();
    await studio.shot('faults');
    await page.keyboard.press('s');
    const inside = await studio.pixel(middle);
    await page.mouse.move(inside.x, inside.y);
    await studio.seen('preview');
    await studio.shot('split');
    await page.mouse.click(inside.x, inside.y);
    await studio.until((s) => s.curves.length > 6);
    await page.keyboard.press('x');
    // The new curve before the eye; another one goes round behind.
    const before = (await studio.state()).curves.length;
    const middles: number[][] = [];
    for (let k = 0; k < before; k++) middles.push(middleOf(await studio.curve(k)));
    const away = (p: number[]) => Math.hypot(...p.map((x, k) => x - middle[k]!));
    const target = await studio.pixel(middles.sort((a, b) => away(a) - away(b))[0]!);
    await page.mouse.move(target.x, target.y);
    await studio.seen('erase');
    await studio.shot('delete');
    await page.mouse.click(target.x, target.y);
    await studio.until((s) => s.curves.length < before);
    await studio.idle();
    await studio.close();
  });

  it('try sizes on one patch, refine its sections, hide it, and show seams, relief and waves', async () => {
    const studio = await four();
    const { page } = studio;
    await page.keyboard.press('v');
    await page.getByRole('tab', { name: 'View' }).click();
    await page.getByRole('radio', { name: 'Surfaces' }).click();
    await page.getByRole('checkbox', { name: 'Angles of seams' }).check();
    await page.getByRole('checkbox', { name: 'Iso-curves' }).check();
    await studio.idle();
    await studio.shot('view');
    await studio.click(middle);
    await page.getByRole('heading', { name: /^Patch/ }).waitFor();
    await page.getByRole('spinbutton', { name: 'Control points, u' }).fill('12');
    await page.getByText('Alone it would come to').waitFor();
    await page.getByText('Cells of each section').click();
    await page.getByRole('spinbutton', { name: 'u, section 1' }).fill('40');
    await studio.shot('patch');
    await page.getByRole('button', { name: 'Set the cells' }).click();
    const refined = await studio.until(
      (s) => s.done.at(-1)?.edit === 'sections' && s.patches.some((p) => p.fitted?.cells[0] === 40),
    );
    expect(refined.patches.some((p) => p.sections[0]?.[0] === 40)).toBe(true);
    await studio.idle();
    await page.getByRole('button', { name: /^Take/ }).isHidden();
    await studio.click(middle);
    await page.getByRole('button', { name: 'Hide it' }).click();
    await studio.idle();
    await page.getByRole('tab', { name: 'View' }).click();
    await page.getByText('1 patch hidden.').waitFor();
    await page.getByRole('checkbox', { name: 'Cut the view open' }).check();
    await studio.idle();
    await studio.shot('section');
    await page.getByRole('checkbox', { name: 'Cut the view open' }).uncheck();
    await page.getByRole('button', { name: 'Show all patches' }).click();
    await page.getByRole('tab', { name: 'Relief' }).click();
    await page.getByRole('img', { name: /^Displacement map/ }).waitFor();
    await page.getByRole('slider', { name: 'Strength in the view' }).fill('5');
    await page.getByRole('radio', { name: 'Only the shorter' }).click();
    await studio.until((s) => s.longest !== null);
    await studio.idle();
    await studio.shot('relief');
    await page.getByRole('radio', { name: 'All waves' }).click();
    await studio.until((s) => s.longest === null);
    await studio.idle();
    await studio.close();
  });

  it('pause at coarse grids and go on', async () => {
    const studio = await four();
    const { page } = studio;
    await page.getByRole('tab', { name: 'Surface' }).click();
    await page.getByRole('button', { name: 'Pause at coarse grids' }).click();
    await studio.until((s) => s.stages.find((x) => x.name === 'surfaces')?.is === 'partial' && s.jobs.length === 0);
    await page.getByRole('tab', { name: 'Draw' }).click();
    await page.getByText('Grids are coarse as yet').waitFor();
    await studio.idle();
    await studio.shot('coarse');
    await page.getByRole('button', { name: 'Fit surfaces' }).first().click();
    await studio.until((s) => s.stages.find((x) => x.name === 'surfaces')?.is === 'fresh');
    await studio.idle();
    await studio.close();
  });

  it('raise the relief with the brush, smooth it, and take both back', async () => {
    const studio = await four();
    const { page } = studio;
    await studio.until((s) => s.layers.displaced !== undefined && s.jobs.length === 0);
    await studio.idle();
    await page.keyboard.press('r');
    await page.getByRole('radio', { name: 'Raises' }).waitFor();
    await studio.idle();
    const box = (await page.locator('canvas').first().boundingBox())!;
    const middle = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
    const stroke = async () => {
      await page.mouse.move(middle.x - 60, middle.y);
      await page.mouse.down();
      await page.mouse.move(middle.x + 60, middle.y + 20, { steps: 12 });
      await studio.shot('brush');
      await page.mouse.up();
    };
    await page.keyboard.press(']');
    await stroke();
    await studio.until((s) => s.relief_done.join() === 'stroke' && s.jobs.length === 0);
    await studio.shown();
    await page.getByRole('radio', { name: 'Smooths' }).click();
    await stroke();
    await studio.until((s) => s.relief_done.join() === 'stroke,blur' && s.jobs.length === 0);
    await studio.idle();
    await studio.shot('sculpted');
    await page.keyboard.press('Control+z');
    await studio.until((s) => s.relief_done.join() === 'stroke' && s.relief_undone.join() === 'blur');
    await page.getByRole('button', { name: 'Take the last back' }).click();
    await studio.until((s) => s.relief_done.length === 0 && s.jobs.length === 0);
    await studio.idle();
    await studio.close();
  });

  it('go another way in the history and come back', async () => {
    const studio = await four();
    const { page } = studio;
    await edit(studio, { edit: 'undo', count: 2 });
    await edit(studio, { edit: 'paint', picks: [corners[0], corners[2]] });
    await page.getByRole('tab', { name: 'History' }).click();
    await page.getByRole('heading', { name: 'Other ways' }).waitFor();
    await studio.idle();
    await studio.shot('branches');
    await page.getByRole('button', { name: 'Go there' }).first().click();
    await studio.until((s) => s.done.length === 4 && s.patches.length === 2);
    await studio.idle();
    await studio.close();
  });

  it('save a session that the program replays to the same network', async () => {
    const studio = await four();
    const { page } = studio;
    await page.getByRole('tab', { name: 'History' }).click();
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Save as a script' }).click();
    const script = join(SHOTS, 'session.toml');
    await (await download).saveAs(script);
    await studio.until((s) => s.project?.saved === true);
    await studio.close();
    const run = (...args: string[]) => {
      const ran = spawnSync(PROGRAM, [...args, '-q', '--force'], { cwd: program.folder, encoding: 'utf8' });
      expect([ran.status, ran.stderr]).toEqual([0, '']);
    };
    run('edit', 'ball.obj', script, '-o', 'again.planish', '--no-fit');
    run('export', 'again.planish', '-o', 'again.json');
    run('export', 'ball.planish', '-o', 'first.json');
    const [first, again] = ['first', 'again'].map((n) => readFileSync(join(program.folder, `${n}.json`), 'utf8'));
    expect(again).toBe(first);
  });

  it('look at points, leave some out with a lasso, and make a mesh', async () => {
    writeFileSync(join(program.folder, 'stone.xyz'), scan(6000, 0.004));
    const studio = await ball();
    const { page } = studio;
    await page.getByRole('button', { name: 'Put the project away' }).click();
    await studio.until((s) => s.project === null);
    await page.locator('input[type=file]').setInputFiles(join(program.folder, 'stone.xyz'));
    await studio.until((s) => s.layers.points !== undefined);
    await page.getByRole('button', { name: 'Look at the points' }).click();
    const looked = await studio.until((s) => s.cleaned !== null);
    expect(looked.cleaned!.outliers).toBeGreaterThan(5);
    await page.getByRole('radio', { name: 'Outliers' }).click();
    await studio.idle();
    await studio.shot('outliers');
    await page.keyboard.press('l');
    const box = (await page.locator('canvas').first().boundingBox())!;
    const at = (x: number, y: number) => ({ x: box.x + x * box.width, y: box.y + y * box.height });
    await page.mouse.move(at(0.02, 0.02).x, at(0.02, 0.02).y);
    await page.mouse.down();
    for (const [x, y] of [
      [0.98, 0.02],
      [0.98, 0.3],
      [0.02, 0.3],
    ] as const)
      await page.mouse.move(at(x, y).x, at(x, y).y, { steps: 6 });
    await studio.shot('lasso');
    await page.mouse.up();
    const less = await studio.until((s) => s.left_out > 0);
    expect(less.project!.points + less.left_out).toBe(6000);
    await page.getByRole('button', { name: 'Take all in again' }).click();
    await studio.until((s) => s.left_out === 0);
    await page.keyboard.press('Control+Shift+z');
    await studio.until((s) => s.left_out === less.left_out);
    await page.keyboard.press('Control+z');
    await studio.until((s) => s.left_out === 0);
    await page.getByRole('spinbutton', { name: /Edge of a cell/ }).fill('1.2');
    await page.getByRole('button', { name: 'Close holes' }).click();
    const meshed = await studio.until((s) => s.layers.mesh !== undefined);
    expect(meshed.project!.triangles).toBeGreaterThan(500);
    await studio.idle();
    await page.getByRole('tab', { name: 'History' }).click();
    await page.getByRole('button', { name: 'Mesh made' }).waitFor();
    await studio.shot('history');
    await page.getByRole('button', { name: 'Undo' }).click();
    await studio.until((s) => s.layers.mesh === undefined && s.layers.points !== undefined);
    await studio.idle();
    await studio.close();
  });

  it('carry a network over from another project by landmarks', async () => {
    const other = await four();
    await other.close();
    await program.end();
    writeFileSync(join(program.folder, 'stone.obj'), sphere(30));
    const studio = await Studio.open(await program.start('stone.obj'));
    const { page } = studio;
    await studio.until((s) => s.layers.mesh !== undefined && s.project?.name === 'stone');
    await studio.idle();
    await page.keyboard.press('w');
    await page.getByRole('listitem').filter({ hasText: 'ball' }).getByRole('button').click();
    await studio.until((s) => s.peer?.curves === 4);
    await studio.idle();
    for (const k of [0, 1, 2, 3]) {
      await studio.idle();
      const pixel = await studio.pixel([0, 0, 0]);
      const [dx, dy] = [
        [-40, -30],
        [40, -30],
        [40, 30],
        [-40, 30],
      ][k]!;
      const click = async (scale: number) => {
        await page.mouse.move(pixel.x + scale * dx!, pixel.y + scale * dy!);
        await page.mouse.click(pixel.x + scale * dx!, pixel.y + scale * dy!);
      };
      await click(1);
      if (k === 3) await studio.shot('carry');
      await studio.idle();
      await click(1);
    }
    await page.getByText('4 pairs of places.').waitFor();
    await page.getByRole('button', { name: 'Put it away' }).click();
    await studio.until((s) => s.peer === null);
    await studio.idle();
    await studio.close();
  });

  it('take the demonstration part through the tour of the guide', async () => {
    const studio = await Studio.open(await program.start());
    const { page } = studio;
    await page.getByRole('button', { name: /^Demonstration part/ }).click();
    await studio.until((s) => s.layers.mesh !== undefined);
    await studio.idle();
    await studio.shot('tour-mesh');
    await studio.until((s) => s.project?.saved === true);
    copyFileSync(join(program.folder, 'part.planish'), join(program.folder, 'bare.planish'));
    await page.getByRole('button', { name: 'Draw sharp edges' }).click();
    await studio.until((s) => s.done.length === 1);
    await studio.idle();
    await studio.shot('tour-edges');
    await page.getByRole('button', { name: 'Complete the rest' }).first().click();
    await studio.until((s) => s.stages.find((x) => x.name === 'surfaces')?.is === 'fresh', 170_000);
    await studio.idle();
    await page.getByRole('tab', { name: 'View' }).click();
    for (const [shape, shading] of [
      ['Mesh', 'Clay'],
      ['Mesh', 'Curvature'],
      ['Surfaces', 'Patches'],
      ['Surfaces', 'Deviation'],
      ['Surfaces', 'Zebra'],
      ['With relief', 'Clay'],
    ] as const) {
      await page.getByRole('radio', { name: shape, exact: true }).click();
      await page.getByRole('radio', { name: shading, exact: true }).click();
      await studio.idle();
      await studio.shot(`tour-${shape.toLowerCase().replace(' ', '-')}-${shading.toLowerCase()}`);
    }
    await page.getByRole('radio', { name: 'Surfaces', exact: true }).click();
    await page.getByRole('checkbox', { name: 'Control nets' }).check();
    await studio.idle();
    await studio.shot('tour-nets');
    await page.getByRole('checkbox', { name: 'Control nets' }).uncheck();
    await page.getByRole('tab', { name: 'Relief' }).click();
    await page.getByRole('img', { name: /^Displacement map/ }).waitFor();
    await studio.idle();
    await studio.shot('tour-relief');
    await page.getByRole('tab', { name: 'History' }).click();
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Save as a script' }).click();
    await (await download).saveAs(join(SHOTS, 'tour.toml'));
    await studio.until((s) => s.project?.saved === true);
    await studio.close();
    const run = (...args: string[]) => {
      const ran = spawnSync(PROGRAM, [...args, '-q'], { cwd: program.folder, encoding: 'utf8' });
      expect([ran.status, ran.stderr]).toEqual([0, '']);
    };
    run('edit', 'bare.planish', TOUR, '-o', 'tour.planish', '--no-fit');
    run('export', 'tour.planish', '-o', 'tour.json');
    run('export', 'part.planish', '-o', 'part.json');
    const [tour, part] = ['tour', 'part'].map((n) => readFileSync(join(program.folder, `${n}.json`), 'utf8'));
    expect(tour).toBe(part);
  }, 300_000);
});
