import { defineConfig } from 'vitest/config';

// One browser for all; each file has a server of its own. The time is a ceiling for a machine that also builds something else.
export default defineConfig({
  test: {
    include: ['tests/e2e/**/*.test.ts'],
    testTimeout: 240_000,
    hookTimeout: 60_000,
    fileParallelism: false,
    sequence: { concurrent: false },
  },
});
