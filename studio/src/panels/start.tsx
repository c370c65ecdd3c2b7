// What is shown without a project: where files are dropped, projects of the folder, samples.
import { useRef } from 'preact/hooks';
import type { App } from '../app';
import * as store from '../model/store';
import { SAMPLES, TEXT } from '../model/texts';

const words = TEXT.start;
const FILES = '.planish,.ply,.obj,.stl,.glb,.gltf,.step,.stp,.e57,.las,.laz,.pcd,.xyz,.txt,.csv,.asc,.pts,.npy,.npz';

export function Start({ app }: { app: App }) {
  const input = useRef<HTMLInputElement>(null);
  const { files } = store.state.value;
  const busy = store.jobs.value.length > 0;
  return (
    <main class="start">
      <div class="card">
        <h1>{words.title}</h1>
        <button type="button" class="drop" onClick={() => input.current?.click()} disabled={busy}>
          <strong>{busy ? store.jobs.value[0]!.title : words.drop}</strong>
          <span>{busy ? words.moment : words.choose}</span>
        </button>
        <input
          ref={input}
          type="file"
          hidden
          accept={FILES}
          aria-label={words.chooseFile}
          onChange={(e) => {
            const file = e.currentTarget.files?.[0];
            if (file) void app.drop(file);
            e.currentTarget.value = '';
          }}
        />
        {files.length > 0 && (
          <>
            <h2>{words.projects}</h2>
            <ul class="cards">
              {files.map((file) => (
                <li key={file}>
                  <button type="button" disabled={busy} onClick={() => void app.openFile(file)}>
                    <strong>{file.replace(/\.planish$/i, '')}</strong>
                    <span>{words.goOn}</span>
                  </button>
                </li>
              ))}
            </ul>
          </>
        )}
        <h2>{words.samples}</h2>
        <ul class="cards">
          {SAMPLES.map((s) => (
            <li key={s.sample}>
              <button type="button" disabled={busy} onClick={() => void app.sample(s.sample)}>
                <strong>{s.name}</strong>
                <span>{s.note}</span>
              </button>
            </li>
          ))}
        </ul>
      </div>
    </main>
  );
}
