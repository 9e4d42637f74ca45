// The linter of web/ and clients/: what the compiler and prettier do not see. `scripts/web` runs it from the repository's root.
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import tseslint from 'typescript-eslint';

const root = join(dirname(fileURLToPath(import.meta.url)), '..');

export default [
  { ignores: ['**/node_modules/**', 'web/dist/**', 'clients/typescript/src/contract.generated.ts', '**/*.d.ts'] },
  { linterOptions: { reportUnusedDisableDirectives: 'error' } },
  {
    files: ['web/**/*.{js,mjs,ts}', 'clients/**/*.{mjs,ts}'],
    rules: {
      eqeqeq: 'error',
      'max-lines': ['error', { max: 500 }],
      'max-params': ['error', { max: 5 }],
      'no-constant-binary-expression': 'error',
      'no-implicit-coercion': 'error',
      'no-self-compare': 'error',
      'no-shadow': 'error',
      'no-throw-literal': 'error',
      'no-unreachable-loop': 'error',
      'no-unused-vars': 'error',
      'no-useless-return': 'error',
      'no-var': 'error',
      'object-shorthand': 'error',
      'prefer-const': 'error',
    },
  },
  {
    files: ['web/src/**/*.ts', 'clients/**/*.ts'],
    languageOptions: {
      parser: tseslint.parser,
      parserOptions: { project: ['web/tsconfig.json'], tsconfigRootDir: root },
    },
    plugins: { '@typescript-eslint': tseslint.plugin },
    rules: {
      // Those of the compiler and of typescript-eslint take their place.
      'no-shadow': 'off',
      'no-unused-vars': 'off',
      'no-throw-literal': 'off',
      '@typescript-eslint/await-thenable': 'error',
      '@typescript-eslint/consistent-type-imports': ['error', { fixStyle: 'inline-type-imports' }],
      '@typescript-eslint/no-explicit-any': 'error',
      '@typescript-eslint/no-floating-promises': 'error',
      '@typescript-eslint/no-misused-promises': ['error', { checksVoidReturn: { attributes: false } }],
      '@typescript-eslint/no-non-null-assertion': 'error',
      '@typescript-eslint/no-shadow': 'error',
      '@typescript-eslint/no-unnecessary-type-assertion': 'error',
      '@typescript-eslint/only-throw-error': 'error',
      '@typescript-eslint/switch-exhaustiveness-check': ['error', { considerDefaultExhaustiveForUnions: true }],
    },
  },
];
