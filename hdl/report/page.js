for (const slider of document.querySelectorAll("input[data-compare]")) {
  const pair = document.getElementById(slider.dataset.compare);
  const show = () => {
    pair.style.setProperty("--at", slider.value + "%");
    slider.setAttribute("aria-valuetext", 100 - slider.value + " % of each picture rectified");
  };
  slider.addEventListener("input", show);
  show();
}
