// The panel of a network that is carried over from another project of the folder.
import type { App } from '../app';
import * as store from '../model/store';
import { TEXT } from '../model/texts';
import { Choice, Section } from './parts';

/** Pairs of places that a rigid fit needs. */
const FEWEST_PAIRS = 3;

export function CarrySection({ app }: { app: App }) {
  const { files, peer } = store.state.value;
  const words = TEXT.carry;
  const pairs = store.landmarks.value.filter((l) => l.own !== null).length;
  if (store.tool.value !== 'carry') return null;
  return (
    <Section title={words.title}>
      <p class="faint">{words.note}</p>
      {!peer && (
        <ul class="list">
          {files.map((file) => (
            <li key={file}>
              <span>{file.replace(/\.planish$/i, '')}</span>
              <button type="button" class="small" onClick={() => void app.peer(file)}>
                {words.from}
              </button>
            </li>
          ))}
        </ul>
      )}
      {peer && (
        <>
          <Choice
            label={words.title}
            value={store.shape.value === 'peer' ? 'peer' : 'mesh'}
            options={[
              ['peer', words.onOther],
              ['mesh', words.onOwn],
            ]}
            onPick={store.showShape}
          />
          <p>{peer.curves > 0 ? words.pairs(pairs) : words.noCurves}</p>
          <div class="row">
            <button
              type="button"
              class="primary"
              disabled={pairs < FEWEST_PAIRS || peer.curves === 0}
              onClick={() => void app.carry()}
            >
              {words.go}
            </button>
            {store.landmarks.value.length > 0 && (
              <button
                type="button"
                onClick={() => {
                  store.landmarks.value = store.landmarks.value.slice(0, -1);
                }}
              >
                {words.back}
              </button>
            )}
            <button type="button" onClick={() => void app.peer(null)}>
              {words.away}
            </button>
          </div>
        </>
      )}
    </Section>
  );
}
