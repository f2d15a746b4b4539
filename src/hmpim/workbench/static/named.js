// A name for those who hear the page, where Quasar gives the focus to a part without any: the button
// that chooses a file.
(() => {
  function name() {
    for (const button of document.querySelectorAll(".q-uploader__header [role=button]")) {
      if (!button.hasAttribute("aria-label")) button.setAttribute("aria-label", "Choose a file");
    }
  }
  document.addEventListener("DOMContentLoaded", () => {
    new MutationObserver(name).observe(document.body, { subtree: true, childList: true });
    name();
  });
})();
