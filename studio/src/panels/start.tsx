// What is shown without a project: where files are dropped, projects of the folder, samples.
import { useRef } from 'preact/hooks';
import type { App } from '../app';
import * as store from '../model/store';
import type { Sample } from '../protocol/types';

const SAMPLES: { sample: Sample; name: string; note: string }[] = [
  { sample: 'part', name: 'Demonstration part', note: 'a mesh with machined edges and relief' },
  { sample: 'scan', name: 'Noisy scan', note: '60 000 points of that part, with outliers' },
  { sample: 'bracket', name: 'Bracket', note: 'a mesh of flat faces, bores and fillets' },
];
const FILES = '.planish,.ply,.obj,.stl,.glb,.gltf,.e57,.las,.laz,.pcd,.xyz,.txt,.csv,.asc,.pts,.npy,.npz';

export function Start({ app }: { app: App }) {
  const input = useRef<HTMLInputElement>(null);
  const { files } = store.state.value;
  const busy = store.jobs.value.length > 0;
  return (
    <main class="start">
      <div class="card">
        <h1>Draw patches on a scan, and watch the surface follow</h1>
        <button type="button" class="drop" onClick={() => input.current?.click()} disabled={busy}>
          <strong>{busy ? store.jobs.value[0]!.title : 'Drop a scan, a mesh or a project here'}</strong>
          <span>{busy ? 'A moment ...' : 'or choose a file: E57, LAS, PLY, PCD, XYZ, OBJ, STL, GLB, .planish'}</span>
        </button>
        <input
          ref={input}
          type="file"
          hidden
          accept={FILES}
          aria-label="Choose a file"
          onChange={(e) => {
            const file = e.currentTarget.files?.[0];
            if (file) void app.drop(file);
            e.currentTarget.value = '';
          }}
        />
        {files.length > 0 && (
          <>
            <h2>Projects in this folder</h2>
            <ul class="cards">
              {files.map((file) => (
                <li key={file}>
                  <button type="button" disabled={busy} onClick={() => void app.openFile(file)}>
                    <strong>{file.replace(/\.planish$/i, '')}</strong>
                    <span>go on</span>
                  </button>
                </li>
              ))}
            </ul>
          </>
        )}
        <h2>To try</h2>
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
