// A program, a browser, and a page on it. Pages that complain in their console fail their test.
import { type ChildProcess, spawn } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { type Browser, chromium, type Page } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import type { State } from '../../src/protocol/types';

const ROOT = resolve(import.meta.dirname, '../../..');
export const PROGRAM = join(ROOT, 'target/release/planish');
const BROWSERS = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];
/** Pictures for people to look at. */
export const SHOTS = join(ROOT, 'out/studio');

export const chromiumPath = process.env.PLANISH_CHROMIUM ?? BROWSERS.find((p) => existsSync(p));
if (!chromiumPath) console.log('skipped: the tests in a browser; there is no chromium');

/** While the page is worked on: it comes from `studio/dist`, and the program need not be built again. */
const PAGE_FROM_DIST = process.env.PLANISH_PAGE === 'dist';
const DIST = join(ROOT, 'studio/dist');
const TYPES: Record<string, string> = { html: 'text/html', js: 'text/javascript', css: 'text/css' };

let browser: Browser;

/** Opens the browser for the tests of a file. */
export function withBrowser(more: string[] = []): void {
  beforeAll(async () => {
    mkdirSync(SHOTS, { recursive: true });
    browser = await chromium.launch({
      executablePath: chromiumPath!,
      args: [
        '--no-sandbox',
        ...(PAGE_FROM_DIST ? ['--disable-features=LocalNetworkAccessChecks'] : []),
        '--disable-quic',
        '--no-first-run',
        '--use-angle=swiftshader',
        '--enable-unsafe-swiftshader',
        '--force-device-scale-factor=1',
        '--hide-scrollbars',
        ...more,
      ],
    });
  });
  afterAll(async () => {
    await browser?.close();
  });
}

/** A running program in a folder of its own. */
export class Program {
  private process: ChildProcess | null = null;
  readonly folder = mkdtempSync(join(tmpdir(), 'planish-studio-'));
  url = '';

  async start(...args: string[]): Promise<string> {
    const process = spawn(PROGRAM, ['studio', '--no-open', ...args], { cwd: this.folder });
    this.process = process;
    let out = '';
    let err = '';
    process.stderr.on('data', (d) => {
      err += d;
    });
    this.url = await new Promise<string>((found, failed) => {
      process.stdout.on('data', (d) => {
        out += d;
        const url = /http:\S+/.exec(out);
        if (url) found(url[0]);
      });
      process.on('exit', (code) => failed(new Error(`planish studio ended with ${code}: ${err}`)));
    });
    return this.url;
  }

  get pid(): number {
    return this.process?.pid ?? 0;
  }

  /** Ends it, with a signal; returns the exit status. */
  async end(signal: 'SIGINT' | 'SIGKILL' = 'SIGINT'): Promise<number | null> {
    const process = this.process;
    if (!process || process.exitCode !== null) return process?.exitCode ?? null;
    const ended = new Promise<number | null>((done) => process.on('exit', (code) => done(code)));
    process.kill(signal);
    this.process = null;
    return ended;
  }

  remove(): void {
    rmSync(this.folder, { recursive: true, force: true });
  }
}

/** A page with what tests ask of it. */
export class Studio {
  private faults: string[] = [];

  private constructor(readonly page: Page) {
    page.on('pageerror', (e) => this.faults.push(e.stack ?? e.message));
    page.on('console', (m) => {
      // A server that ends on purpose cuts the connection.
      const cut = /WebSocket|ERR_CONNECTION_REFUSED/.test(m.text());
      if ((m.type() === 'error' || m.type() === 'warning') && !cut) this.faults.push(m.text());
    });
    page.on('response', (r) => {
      if (r.status() >= 400) this.faults.push(`${r.status()} ${r.url()}`);
    });
  }

  static async open(url: string, size = { width: 1280, height: 800 }): Promise<Studio> {
    const studio = new Studio(await browser.newPage({ viewport: size, acceptDownloads: true }));
    if (PAGE_FROM_DIST) {
      await studio.page.route(/\/(studio\.(js|css))?$/, async (route) => {
        const name = new URL(route.request().url()).pathname.slice(1) || 'index.html';
        await route.fulfill({
          body: readFileSync(join(DIST, name)),
          contentType: TYPES[name.split('.').pop()!] ?? 'text/plain',
        });
      });
    }
    await studio.page.goto(url);
    await studio.page.waitForFunction(() => '__studio' in window);
    return studio;
  }

  async close(): Promise<void> {
    await this.page.close();
    expect(this.faults).toEqual([]);
  }

  state(): Promise<State> {
    return this.page.evaluate(() => (window as never as { __studio: { state(): State } }).__studio.state());
  }

  /** Waits until nothing is asked for, computed or drawn. */
  async idle(timeout = 80_000): Promise<void> {
    await this.page.waitForFunction(
      () => (window as never as { __studio?: { idle(): boolean } }).__studio?.idle(),
      null,
      { timeout, polling: 30 },
    );
  }

  /** Waits until what the state names is on the screen; figures of it may still be measured. */
  async shown(timeout = 80_000): Promise<void> {
    await this.page.waitForFunction(
      () => (window as never as { __studio: { shown(): boolean } }).__studio.shown(),
      null,
      { timeout, polling: 5 },
    );
  }

  /** Waits until the state is as wanted. */
  async until(wanted: (state: State) => boolean, timeout = 80_000): Promise<State> {
    const end = Date.now() + timeout;
    for (;;) {
      const state = await this.state();
      if (wanted(state)) return state;
      if (Date.now() > end) throw new Error(`never: ${wanted}; ${JSON.stringify(state.stages)}`);
      await this.page.waitForTimeout(30);
    }
  }

  /** Course of a curve of the state, once the page has it: three numbers a point. */
  async curve(k: number): Promise<number[]> {
    const course = await this.page.waitForFunction(
      (n) => (window as never as { __studio: { curve(n: number): number[] | null } }).__studio.curve(n),
      k,
      { polling: 30 },
    );
    return (await course.jsonValue())!;
  }

  /** Waits until lines of a kind are shown. */
  async seen(line: 'preview' | 'erase'): Promise<void> {
    type View = {
      lines: Record<string, { object: { visible: boolean } }>;
      overlay: { has(name: string): boolean };
    };
    await this.page.waitForFunction(
      (name) => {
        const { view } = (window as never as { __studio: { app: { view: View } } }).__studio.app;
        return view.lines[name]?.object.visible ?? view.overlay.has(name);
      },
      line,
      { polling: 30 },
    );
  }

  /** Pixel of the page of a world position. */
  async pixel(p: readonly number[]): Promise<{ x: number; y: number }> {
    const box = (await this.page.locator('canvas').first().boundingBox())!;
    const at = await this.page.evaluate(
      (q) => (window as never as { __studio: { project(p: number[]): { x: number; y: number } } }).__studio.project(q),
      [...p],
    );
    return { x: box.x + at.x, y: box.y + at.y };
  }

  async click(p: readonly number[]): Promise<void> {
    const { x, y } = await this.pixel(p);
    await this.page.mouse.move(x, y);
    await this.page.mouse.click(x, y);
  }

  /** Drags from one pixel to another in steps. */
  async drag(a: { x: number; y: number }, b: { x: number; y: number }, steps = 8): Promise<void> {
    await this.page.mouse.move(a.x, a.y);
    await this.page.mouse.down();
    await this.page.mouse.move(b.x, b.y, { steps });
    await this.page.mouse.up();
  }

  async shot(name: string): Promise<void> {
    await this.page.screenshot({ path: join(SHOTS, `${name}.png`) });
  }
}
