// The socket: requests with answers, state as it comes, geometry by name. After a cut it connects again and goes on.
import { TEXT } from '../model/texts';
import { type Geometry, Joiner } from './frames';
import type { Edit, Layer, Message, Request, State, Why } from './types';

export type Connection = 'connecting' | 'open' | 'lost' | 'refused';

/** A refused request. */
export class Refused extends Error {
  readonly why: Why;

  constructor(why: Why) {
    super(why.message);
    this.why = why;
  }
}

export interface Listener {
  state(state: State): void;
  progress(jobs: State['jobs']): void;
  geometry(geometry: Geometry): void;
  connection(connection: Connection): void;
  /** Something failed that no request asked for. */
  refused(why: Why): void;
  /** The server was started anew: names of geometry are of another run. */
  restarted(): void;
}

export type Body = Request extends infer R ? (R extends { id: number } ? Omit<R, 'id'> : never) : never;
export type Answer = Extract<Message, { id: number }>;

/** Waiting times before the next try, milliseconds. */
const RETRY_MS = [200, 500, 1000, 2000, 4000];
/** The protocol that this page speaks. */
const PROTOCOL = 1;

export class Client {
  private socket: WebSocket | null = null;
  private joiner = new Joiner();
  private waiting = new Map<number, { done: (answer: Answer) => void; failed: (error: Error) => void }>();
  private last = 0;
  private tries = 0;
  private run = '';

  constructor(
    private readonly token: string,
    private readonly listener: Listener,
  ) {}

  connect(): void {
    this.listener.connection(this.run ? 'lost' : 'connecting');
    const socket = new WebSocket(`ws://${location.host}/ws?token=${encodeURIComponent(this.token)}`);
    socket.binaryType = 'arraybuffer';
    let opened = false;
    socket.onopen = () => {
      opened = true;
      this.tries = 0;
    };
    socket.onmessage = (event) => {
      if (typeof event.data === 'string') this.take(JSON.parse(event.data) as Message);
      else {
        const geometry = this.joiner.add(event.data as ArrayBuffer);
        if (geometry) this.listener.geometry(geometry);
      }
    };
    socket.onclose = () => {
      this.socket = null;
      this.joiner = new Joiner();
      for (const { failed } of this.waiting.values()) {
        failed(new Refused({ message: TEXT.connection.cut, hint: TEXT.connection.back }));
      }
      this.waiting.clear();
      // A server that never let this page in will not do so the next time.
      const hopeless = !opened && !this.run && this.tries >= 3;
      this.listener.connection(hopeless ? 'refused' : 'lost');
      if (!hopeless) setTimeout(() => this.connect(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
    };
    this.socket = socket;
  }

  private take(message: Message): void {
    switch (message.type) {
      case 'welcome':
        if (message.protocol !== PROTOCOL) return location.reload();
        if (this.run && this.run !== message.run) this.listener.restarted();
        this.run = message.run;
        return this.listener.connection('open');
      case 'state': {
        const { type: _, ...state } = message;
        return this.listener.state(state);
      }
      case 'progress':
        return this.listener.progress(message.jobs);
      default: {
        const waiting = this.waiting.get(message.id);
        this.waiting.delete(message.id);
        if (message.type !== 'refused') waiting?.done(message);
        else if (waiting) waiting.failed(new Refused(message.why));
        else this.listener.refused(message.why);
      }
    }
  }

  /** Asks the server; fails with [`Refused`]. */
  ask(body: Body): Promise<Answer> {
    const id = ++this.last;
    return new Promise((done, failed) => {
      if (this.socket?.readyState !== WebSocket.OPEN) {
        failed(new Refused({ message: 'There is no connection.', hint: 'It comes back by itself.' }));
        return;
      }
      this.waiting.set(id, { done, failed });
      this.socket.send(JSON.stringify({ ...body, id }));
    });
  }

  edit(edit: Edit): Promise<Answer> {
    return this.ask({ type: 'edit', edit });
  }

  get(layer: Layer): Promise<Answer> {
    return this.ask({ type: 'get', layer });
  }

  /** Sends a file. */
  async upload(file: File): Promise<void> {
    const name = encodeURIComponent(file.name);
    const answer = await fetch(`/upload?token=${this.token}&name=${name}`, { method: 'POST', body: file });
    if (!answer.ok) throw new Refused({ message: `${file.name}: ${await answer.text()}` });
  }

  /** The address of a file that was made. */
  url(path: string): string {
    return `${path}?token=${this.token}`;
  }

  /** Cuts the connection, for tests. */
  cut(): void {
    this.socket?.close();
  }
}
