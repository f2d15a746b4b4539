// Names for those who hear the page, where Quasar gives the focus to a part without any: a slider's
// thumb, and the button that chooses a file. What a slider says of itself is said where the focus is.
(() => {
  const NAMED = ["aria-label", "aria-valuemin", "aria-valuemax", "aria-valuenow", "aria-disabled"];
  function name() {
    for (const slider of document.querySelectorAll(".q-slider")) {
      const thumb = slider.querySelector("[tabindex]");
      if (!thumb) continue;
      if (slider.getAttribute("role") === "slider") slider.setAttribute("role", "presentation");
      if (thumb.getAttribute("role") !== "slider") thumb.setAttribute("role", "slider");
      for (const attribute of NAMED) {
        const said = slider.getAttribute(attribute);
        if (said !== null && said !== thumb.getAttribute(attribute)) {
          thumb.setAttribute(attribute, said);
        }
      }
    }
    for (const button of document.querySelectorAll(".q-uploader__header [role=button]")) {
      if (!button.hasAttribute("aria-label")) button.setAttribute("aria-label", "Choose a file");
    }
  }
  const watch = { subtree: true, childList: true, attributes: true, attributeFilter: NAMED };
  document.addEventListener("DOMContentLoaded", () => {
    new MutationObserver(name).observe(document.body, watch);
    name();
  });
})();
