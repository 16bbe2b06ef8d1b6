"use strict";
/** Escape the characters that YAML takes for line breaks, or does not allow, although JSON has them. */
function escaped(text) {
  return text.replace(/[\0-\x1f\x7f-\x9f\u2028\u2029\ufeff]/g,
    character => `\\u${character.charCodeAt(0).toString(16).padStart(4, "0")}`);
}
